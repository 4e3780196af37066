// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mpm/scene.hpp"

/// A contact's stiffness has a default that follows the material (mpm/contact_law.hpp), in a fit as
/// in any other simulation.
namespace matterfit::job {

/// The same surface with another contact.
[[nodiscard]] mpm::ColliderPtr with_contact(const mpm::ColliderPtr& collider,
                                            const mpm::Contact& contact);

/// The stiffness of the scene's colliders, then of its walls [Pa/m], as the body meets them: their
/// own, else the default.
[[nodiscard]] std::vector<double> contact_stiffnesses(const mpm::Scene& scene,
                                                      const mpm::Body& body);

/// Whether the stiffness of a collider or of the walls is another one for each of several bodies.
[[nodiscard]] bool follows_several_bodies(const mpm::Scene& scene);

}  // namespace matterfit::job
