// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/vec.hpp"
#include "fit/model/experiment.hpp"
#include "fit/model/quantity.hpp"
#include "mpm/scene.hpp"

namespace matterfit::fit {

/// A value for any quantity, fitted or not: one component, or all alike without one.
struct Assignment {
  Address at;
  double value = 0.0;
};

/// What is simulated otherwise than the scene and the parameters say.
struct Variation {
  std::vector<Assignment> set;  ///< after the parameters; in the runs that have such an owner
  /// The grid is moved against the bodies by these fractions of a cell; what is seen stays in
  /// place.
  Vec3d grid_shift = Vec3d::Zero();
  /// Substeps are so many times as long, in (0, 1]: shorter ones show the error of the time step.
  double dt_factor = 1.0;
};

/// Changes a run's scene, to which parameters were applied. Throws Error(kInput) for a factor
/// outside (0, 1] and for a quantity that does nothing there.
void vary(const Variation& variation, const Run& run, mpm::Scene& scene);

/// Sets of it only what moves bodies themselves.
void vary_places(const Variation& variation, const Run& run, mpm::Scene& scene);

/// How a capture of the run is looked at after the same.
[[nodiscard]] Viewing varied(const Variation& variation, const Run& run, std::size_t capture,
                             Viewing viewing);

/// Whether the variation moves the body itself, so that points must be bound to it anew.
[[nodiscard]] bool places(const Variation& variation, const mpm::Body& body);

/// How far a scene is moved as a whole [m] for an offset of the grid in cells: the grid of updated
/// Lagrangian bodies lies in the world, so its offset is one of everything else. To be taken off
/// what is seen.
[[nodiscard]] Vec3d world_shift(const Vec3d& cells, const mpm::Scene& scene);

/// Moves all that a scene holds: bodies, pins, masses, colliders, walls, centres of effects.
void move_world(const Vec3d& by, mpm::Scene& scene);

}  // namespace matterfit::fit
