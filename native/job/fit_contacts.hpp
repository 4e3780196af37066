// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "job/json_reader.hpp"
#include "mpm/scene.hpp"

/// A contact's stiffness has a default that follows the material (mpm/contact_law.hpp). A fit
/// resolves it once and keeps it, so that it does not move with the stiffness that is fitted.
namespace matterfit::job {

/// The same surface with another contact.
[[nodiscard]] mpm::ColliderPtr with_contact(const mpm::ColliderPtr& collider,
                                            const mpm::Contact& contact);

/// Stiffnesses that were resolved, in the order of the scene's lists; 0: as the document has it.
struct FrozenContacts {
  std::vector<double> colliders;        ///< one a collider
  std::vector<double> contacts;         ///< one a pair of `scene.contacts`
  std::vector<mpm::BodyContact> added;  ///< pairs that the scene does not list
  double walls = 0.0;
};

/// Resolves the default stiffness of every contact of the bodies `fitted` (those whose material a
/// fit moves): of several the softest. Contacts with a stiffness of their own stay.
[[nodiscard]] FrozenContacts resolve_contacts(const mpm::Scene& scene,
                                              const std::vector<std::string>& fitted);

/// A scene laid over another one takes the stiffness of the contacts that it has from there, by the
/// names of colliders and bodies.
void inherit(const FrozenContacts& base, const mpm::Scene& base_scene, const mpm::Scene& scene,
             FrozenContacts& frozen);

/// Colliders and walls whose stiffness is held although bodies that are not fitted would have
/// another one: a sentence each, for what such bodies touch them.
[[nodiscard]] std::vector<std::string> shared_contacts(const FrozenContacts& frozen,
                                                       const mpm::Scene& scene,
                                                       const std::vector<std::string>& fitted);

void apply(const FrozenContacts& frozen, mpm::Scene& scene);
/// The same in a document's `scene`.
void write(const FrozenContacts& frozen, Json& scene);

/// Largest ratio of a stiffness in `b` to that in `a`, either way up; 1 where they agree.
[[nodiscard]] double largest_change(const FrozenContacts& a, const FrozenContacts& b);

}  // namespace matterfit::job
