// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "diagnose/model.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// A time at which something known struck a body, and how far the solver's impulse may be off.
struct Impact {
  std::size_t run = 0;
  std::size_t body = 0;                        ///< into Scene::bodies
  int frame = 0;                               ///< in which the impact, or this part of it, ends
  const diagnose::Capture* capture = nullptr;  ///< that shows it
  Eigen::Index begin = 0;                      ///< of its frames the first in contact
  Eigen::Index end = 0;                        ///< and the first after it
  double speed = 0.0;  ///< standard deviation of each component of the velocity after it [m/s]
  double turn = 0.0;   ///< of the spin [rad/s]
  double place = 0.0;  ///< and of the place in a frame of the contact [m]
  double angle = 0.0;  ///< about each axis [rad]
};

/// The impacts that a capture shows, held-out samples included, by time: where its rigid motion (of
/// each frame's tracks, Kabsch) is accelerated otherwise than by gravity near a collider of the
/// scene. A long contact has several. Nothing for a body that is held, without colliders, or not in
/// the total Lagrangian formulation. What a bounce makes of a throw depends on the grid by a
/// hundredth of the impulse, and grows from bounce to bounce: with a free rigid velocity after
/// each, errors stay those of one.
[[nodiscard]] std::vector<Impact> impacts(const diagnose::Capture& capture, const mpm::Scene& scene,
                                          std::size_t run, std::size_t body);

}  // namespace matterfit::job
