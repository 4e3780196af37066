// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

/// Which body lies deepest in which collider.
struct Penetration {
  double depth = 0.0;  ///< [m]
  std::string body;
  std::string collider;
  double stiffness = 0.0;  ///< of that collider's contact [Pa/m]; 0: the solver's own
};

/// The deepest of the particles of one frame; depth 0 where none is inside a collider.
[[nodiscard]] Penetration deepest(const mpm::Scene& scene, const mpm::FrameState& state);

/// "'cube' sank 26 cm into 'ground'. Raise scene.colliders.ground.contact.stiffness (now …) …".
[[nodiscard]] std::string penetration_note(const Penetration& penetration);

}  // namespace matterfit::job
