// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mpm/scene.hpp"

/// A contact's stiffness has a default that follows the material (mpm/contact_law.hpp), in a fit as
/// in any other simulation.
namespace matterfit::mpm {

/// The same surface with another contact.
[[nodiscard]] shape::ColliderPtr with_contact(const shape::ColliderPtr& collider,
                                              const shape::Contact& contact);

/// The stiffness of the scene's colliders, then of its walls [Pa/m], as the body meets them: their
/// own, else the default.
[[nodiscard]] std::vector<double> contact_stiffnesses(const Scene& scene, const Body& body);

/// Whether the stiffness of a collider or of the walls is another one for each of several bodies.
[[nodiscard]] bool follows_several_bodies(const Scene& scene);

}  // namespace matterfit::mpm
