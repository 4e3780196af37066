// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "base/vec.hpp"

/// How far one set of points is from another, in the conventions of the literature this project
/// compares itself with (MASIV, GIC, PAC-NeRF). All results are the same for any number of threads.
namespace matterfit::fit {

/// Options of chamfer() and earth_mover().
struct SetDistanceOptions {
  std::size_t limit = 8192;  ///< a larger set is thinned to this many points by a seeded draw
  std::uint64_t seed = 0;
};

/// Chamfer distance [m²]: mean squared distance to the nearest point of the other set, both
/// directions summed. Its published form is ×1e3. Points that are not finite are left out. Throws
/// Error(kInput) if a set is empty.
[[nodiscard]] double chamfer(std::span<const Vec3d> a, std::span<const Vec3d> b, Arena& arena,
                             const SetDistanceOptions& options = {});

/// Earth mover's distance [m]: mean Euclidean distance under the optimal one-to-one assignment of
/// equally many points of both sets, min(`limit`, |a|, |b|) of each by a seeded draw. Exact
/// (successive shortest augmenting paths, Jonker & Volgenant 1987), O(n³). Throws Error(kInput) if
/// a set is empty, Error(kCancelled) on cancellation.
[[nodiscard]] double earth_mover(std::span<const Vec3d> a, std::span<const Vec3d> b,
                                 const Interrupter& interrupter,
                                 const SetDistanceOptions& options = {2048, 0});

/// Columns of the optimal assignment of an n × n cost matrix (row-major): row i goes to result[i].
[[nodiscard]] std::vector<std::size_t> assign(std::span<const double> cost, std::size_t n,
                                              const Interrupter& interrupter);

/// `count` of the indices [0, size), ascending, by a seeded draw without replacement
/// (SplitMix64, Floyd's algorithm): the same on every machine.
[[nodiscard]] std::vector<std::size_t> draw(std::size_t size, std::size_t count,
                                            std::uint64_t seed);

/// The value below which the fraction `q` in [0, 1] of the values lies, interpolated linearly
/// between order statistics (NumPy's default). Not-finite values are left out; NaN if none is left.
[[nodiscard]] double quantile(std::vector<double> values, double q);

/// Longest side of the bounding box [m], the "body's size" of relative errors.
[[nodiscard]] double body_size(std::span<const Vec3d> points);

}  // namespace matterfit::fit
