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

/// The stiffness of the scene's colliders [Pa/m] as the body meets them, in their order: their own,
/// else the default.
[[nodiscard]] std::vector<double> contact_stiffnesses(const mpm::Scene& scene,
                                                      const mpm::Body& body);

/// Whether the only stiffnesses that follow a material are those of one body's contacts with
/// colliders.
[[nodiscard]] bool follows_one_body(const mpm::Scene& scene);

}  // namespace matterfit::job
