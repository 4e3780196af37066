// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/default_stiffness.hpp"

#include <algorithm>
#include <utility>

#include "mpm/contact_law.hpp"

namespace matterfit::mpm {
namespace {

class Recontacted final : public shape::Collider {
 public:
  Recontacted(shape::ColliderPtr surface, const shape::Contact& contact)
      : shape::Collider(surface->name(), contact), surface_(std::move(surface)) {}

  [[nodiscard]] shape::SurfacePoint closest(const Vec3d& position, double time) const override {
    return surface_->closest(position, time);
  }
  [[nodiscard]] double band() const override { return surface_->band(); }
  [[nodiscard]] bool animated() const override { return surface_->animated(); }

 private:
  shape::ColliderPtr surface_;
};

}  // namespace

shape::ColliderPtr with_contact(const shape::ColliderPtr& collider, const shape::Contact& contact) {
  return std::make_shared<Recontacted>(collider, contact);
}

std::vector<double> contact_stiffnesses(const Scene& scene, const Body& body) {
  std::vector<double> stiffnesses;
  const auto add = [&](const shape::Contact& contact) {
    stiffnesses.push_back(resolve_contact(contact, body, scene.dx).stiffness);
  };
  for (const shape::ColliderPtr& collider : scene.colliders) add(collider->contact());
  if (scene.walls) add(scene.walls->contact);
  return stiffnesses;
}

bool follows_several_bodies(const Scene& scene) {
  const auto follows = [](const shape::Contact& contact) { return contact.stiffness <= 0.0; };
  if (scene.bodies.size() < 2) return false;
  return (scene.walls && follows(scene.walls->contact)) ||
         std::any_of(scene.colliders.begin(), scene.colliders.end(),
                     [&](const auto& collider) { return follows(collider->contact()); });
}

}  // namespace matterfit::mpm
