// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_contacts.hpp"

#include <algorithm>
#include <utility>

#include "mpm/contact_law.hpp"

namespace matterfit::job {
namespace {

class Recontacted final : public mpm::Collider {
 public:
  Recontacted(mpm::ColliderPtr surface, const mpm::Contact& contact)
      : mpm::Collider(surface->name(), contact), surface_(std::move(surface)) {}

  [[nodiscard]] mpm::SurfacePoint closest(const Vec3d& position, double time) const override {
    return surface_->closest(position, time);
  }
  [[nodiscard]] double band() const override { return surface_->band(); }
  [[nodiscard]] bool animated() const override { return surface_->animated(); }

 private:
  mpm::ColliderPtr surface_;
};

}  // namespace

mpm::ColliderPtr with_contact(const mpm::ColliderPtr& collider, const mpm::Contact& contact) {
  return std::make_shared<Recontacted>(collider, contact);
}

std::vector<double> contact_stiffnesses(const mpm::Scene& scene, const mpm::Body& body) {
  std::vector<double> stiffnesses;
  const auto add = [&](const mpm::Contact& contact) {
    stiffnesses.push_back(mpm::resolve_contact(contact, body, scene.dx).stiffness);
  };
  for (const mpm::ColliderPtr& collider : scene.colliders) add(collider->contact());
  if (scene.walls) add(scene.walls->contact);
  return stiffnesses;
}

bool follows_several_bodies(const mpm::Scene& scene) {
  const auto follows = [](const mpm::Contact& contact) { return contact.stiffness <= 0.0; };
  if (scene.bodies.size() < 2) return false;
  return (scene.walls && follows(scene.walls->contact)) ||
         std::any_of(scene.colliders.begin(), scene.colliders.end(),
                     [&](const auto& collider) { return follows(collider->contact()); });
}

}  // namespace matterfit::job
