// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/vec.hpp"
#include "capture/mesh.hpp"
#include "mpm/scene.hpp"

namespace matterfit::capture {

/// How a shape is filled with particles.
struct FillOptions {
  double separation = 0.01;  ///< particle separation h [m]: 8 particles in a cell of 2h
  bool jitter = false;       ///< off: regular lattice (solids); on: one jittered a sub-cell (flows)
  std::uint64_t seed = 0;
  /// The lattice's axes and a point that a plane of cell faces goes through on each axis; default:
  /// world axes, the lattice centred in the shape's bounding box, so that a side of n·h is filled
  /// by exactly n cells.
  Quatd axes = Quatd::Identity();
  std::optional<Vec3d> anchor;
  std::size_t limit = 50'000'000;            ///< particles; more is Error(kInput) with the count
  const Interrupter* interrupter = nullptr;  ///< asked meanwhile, if given: Error(kCancelled)
};

/// A shape filled with particles.
struct FilledBody {
  Points positions;
  std::vector<double> volumes;  ///< [m³]; their sum is the shape's volume
  mpm::Lattice lattice;
  std::vector<mpm::SkinPlane> skin;  ///< of regular lattices: planes of the shape's surface
  double volume = 0.0;               ///< of the shape itself [m³]
  std::string report;                ///< what the fill did, a sentence or a few for the panel
};

/// All fills of shapes: a particle sits in the centre of each lattice cell (or, jittered, at a
/// place in it that depends on seed and cell only) of which at least three tenths are inside, or
/// one twentieth where no neighbour has a particle. The volume inside a cut cell is shared among
/// the particles of the eight cells about its centroid by their distances, so that the body's
/// centre and its moments of inertia and of bending are nearly the shape's; what falls on a cell
/// without a particle goes to the cut cell's own, or else to neighbours over faces (else edges,
/// else corners), which take as much again from the full cell behind them. Cells within 1e-4 of
/// empty or full count as such. Volumes of cells that are cut or took a share are scaled to the
/// shape's exact volume where that is known. Same result for any number of threads. Throws
/// Error(kInput) if nothing is inside, where more than half of the volume is in parts too thin for
/// any particle, or for more than `limit` particles.

/// A polygon mesh. Unwelded corners are joined, faces turned to agree, a shell that faces inward by
/// itself is turned; overlapping shells join, inward shells within another are cavities. Holes are
/// closed by fans around the middle of their rims; what is inside then is decided by the
/// generalised winding number, so that crossing or doubled faces do no harm. The report says which
/// of these happened.
[[nodiscard]] FilledBody fill_mesh(const Mesh& mesh, const FillOptions& options);

/// The Catmull–Clark limit surface of a cage: facets with corners exactly on the limit surface
/// (capture/limit_surface.hpp), no longer than half a separation or hardly anywhere farther from
/// it than a hundredth of one (a tenth where it folds), each face split `least_level` times at
/// least, then as fill_mesh.
[[nodiscard]] FilledBody fill_cage(const Mesh& cage, const FillOptions& options,
                                   int least_level = 2);

[[nodiscard]] FilledBody fill_box(const Vec3d& low, const Vec3d& high, const FillOptions& options);
[[nodiscard]] FilledBody fill_sphere(const Vec3d& centre, double radius,
                                     const FillOptions& options);
/// `centre` is the middle of the axis, `height` the whole length along `axis`.
[[nodiscard]] FilledBody fill_cylinder(const Vec3d& centre, double radius, double height,
                                       const Vec3d& axis, const FillOptions& options);

/// Imported points become the particles as they are; of `options` only `limit` and `axes` are used.
/// Volumes: equal (spacing³) where the points form a lattice along `axes`; otherwise in proportion
/// to the cube of the local spacing, and their sum `total_volume` [m³] or, if that is 0, the volume
/// of the points' closed hull (discs of 1.5 spacings joined, shrunk back to half a spacing).
[[nodiscard]] FilledBody fill_points(const Points& points, const FillOptions& options,
                                     double total_volume = 0.0);

/// The body whose particles are `points`, filled with a regular lattice: their closed hull, as the
/// volume of fill_points, by fill_mesh. Points that form a lattice along `axes` stay as they are.
/// For bodies whose grid is made of the rest shape, which irregular points leave with nearly empty
/// cells.
[[nodiscard]] FilledBody fill_hull(const Points& points, const FillOptions& options);

/// Gaussian splats in plain arrays, equally many of each.
struct GaussianArrays {
  Points centres;                 ///< [m]
  std::vector<Vec3d> scales;      ///< standard deviations along the own axes [m]
  std::vector<Quatd> rotations;   ///< own axes
  std::vector<double> opacities;  ///< 0 … 1
};

struct GaussianFillOptions {
  double opacity_threshold = 0.1;  ///< fainter splats are left out
  bool fill_inside = true;         ///< cavities closed off from outside are filled
  double level = 0.5;              ///< of Σ opacity·exp(−½ d²): the surface
  /// With fill_inside: gaps up to twice this many separations are bridged; 0: none.
  double closing = 1.5;
};

/// Density Σ opacity·exp(−½ d²) of the splats (each widened by a quarter of a separation so that
/// flat ones are seen) on an OpenVDB grid of half a separation; its level surface is closed, rid of
/// cavities, moved back by what the widening of the median splat moved it, and filled as fill_mesh
/// does. Left hollow (`fill_inside` off) it is neither closed nor moved back.
[[nodiscard]] FilledBody fill_gaussians(const GaussianArrays& splats, const FillOptions& options,
                                        const GaussianFillOptions& gaussian_options = {});

/// Gives a body the particles, lattice and skin of a filled shape.
void take_filled(mpm::Body& body, FilledBody&& filled);

/// Turns and moves a filled body and its lattice: x → rotation · x + position.
void place(FilledBody& body, const Vec3d& position, const Quatd& rotation);

}  // namespace matterfit::capture
