// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "base/vec.hpp"
#include "capture/tracks.hpp"

namespace matterfit::capture {

/// to ≈ rotation · from + translation.
struct RigidFit {
  Mat3d rotation = Mat3d::Identity();
  Vec3d translation = Vec3d::Zero();
  std::vector<double> residual_mm;  ///< distance left at each point, those of weight 0 as well [mm]
  double rms_mm = 0.0;              ///< over the points that took part

  [[nodiscard]] Eigen::Matrix4d matrix() const;
  [[nodiscard]] Vec3d operator()(const Vec3d& x) const { return rotation * x + translation; }
};

/// Weighted least-squares proper rotation and translation (Kabsch 1976; Umeyama 1991 without
/// scale). `weights` empty: all 1; a weight of 0 leaves the point out. Throws Error(kInput) if
/// fewer than three points take part, or they lie on a line (the rotation about it is then free).
[[nodiscard]] RigidFit fit_rigid(std::span<const Vec3d> from, std::span<const Vec3d> to,
                                 std::span<const double> weights = {});

/// Mean of each point's visible positions over frames [begin, end); NaN for a point never visible
/// there. Throws Error(kInput) on an empty or outside range.
[[nodiscard]] Points mean_positions(const Tracks& tracks, std::size_t begin, std::size_t end);

/// Fit from the means over quiet frames [begin, end) to model positions.
struct AlignOptions {
  std::size_t begin = 0;
  std::size_t end = 1;
  std::vector<std::size_t> points;   ///< indices into the tracks; empty: 0, 1, …
  std::vector<std::size_t> exclude;  ///< indices into the tracks whose residual is only reported
};

/// `positions[i]` is the model place of `options.points[i]`; residuals come in the same order.
[[nodiscard]] RigidFit align_tracks(const Tracks& tracks, std::span<const Vec3d> positions,
                                    const AlignOptions& options);

}  // namespace matterfit::capture
