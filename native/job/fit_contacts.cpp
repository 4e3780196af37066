// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_contacts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "mpm/contact_law.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::job {
namespace {

/// A stiffness that differs by more than this factor is another one.
constexpr double kOther = 1.05;

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

bool has_name(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// The softest of the bodies' defaults; 0 where the contact has a stiffness.
double resolved(const mpm::Contact& contact, const std::vector<const mpm::Body*>& bodies,
                double dx) {
  double softest = 0.0;
  if (contact.stiffness > 0.0) return 0.0;
  for (const mpm::Body* body : bodies) {
    const double stiffness = mpm::resolve_contact(contact, *body, dx).stiffness;
    softest = softest > 0.0 ? std::min(softest, stiffness) : stiffness;
  }
  return softest;
}

bool same_pair(const mpm::BodyContact& a, const mpm::BodyContact& b) {
  return (a.first == b.first && a.second == b.second) ||
         (a.first == b.second && a.second == b.first);
}

void widen(double a, double b, double& ratio) {
  if (a > 0.0 && b > 0.0) ratio = std::max({ratio, a / b, b / a});
}

}  // namespace

mpm::ColliderPtr with_contact(const mpm::ColliderPtr& collider, const mpm::Contact& contact) {
  return std::make_shared<Recontacted>(collider, contact);
}

FrozenContacts resolve_contacts(const mpm::Scene& scene, const std::vector<std::string>& fitted) {
  std::vector<const mpm::Body*> moved;
  for (const mpm::Body& body : scene.bodies) {
    if (has_name(fitted, body.name)) moved.push_back(&body);
  }
  FrozenContacts frozen;
  for (const mpm::ColliderPtr& collider : scene.colliders) {
    frozen.colliders.push_back(resolved(collider->contact(), moved, scene.dx));
  }
  if (scene.walls) frozen.walls = resolved(scene.walls->contact, moved, scene.dx);
  for (const mpm::BodyContact& pair : scene.contacts) {
    const bool touched = has_name(fitted, pair.first) || has_name(fitted, pair.second);
    std::vector<const mpm::Body*> both;
    for (const mpm::Body& body : scene.bodies) {
      if (body.name == pair.first || body.name == pair.second) both.push_back(&body);
    }
    frozen.contacts.push_back(touched ? resolved(pair.contact, both, scene.dx) : 0.0);
  }
  for (std::size_t a = 0; a < scene.bodies.size(); ++a) {
    for (std::size_t b = a + 1; b < scene.bodies.size(); ++b) {
      const mpm::Body& first = scene.bodies[a];
      const mpm::Body& second = scene.bodies[b];
      if (!has_name(fitted, first.name) && !has_name(fitted, second.name)) continue;
      if (!mpm::is_total(first) && !mpm::is_total(second)) continue;  // they share a grid
      mpm::BodyContact pair{first.name, second.name, {}};
      const bool listed =
          std::any_of(scene.contacts.begin(), scene.contacts.end(),
                      [&](const mpm::BodyContact& other) { return same_pair(pair, other); });
      if (listed) continue;
      pair.contact.stiffness = resolved(pair.contact, {&first, &second}, scene.dx);
      frozen.added.push_back(std::move(pair));
    }
  }
  return frozen;
}

void inherit(const FrozenContacts& base, const mpm::Scene& base_scene, const mpm::Scene& scene,
             FrozenContacts& frozen) {
  for (std::size_t i = 0; i < frozen.colliders.size(); ++i) {
    if (!(frozen.colliders[i] > 0.0)) continue;
    for (std::size_t k = 0; k < base.colliders.size(); ++k) {
      if (base.colliders[k] > 0.0 &&
          base_scene.colliders[k]->name() == scene.colliders[i]->name()) {
        frozen.colliders[i] = base.colliders[k];
      }
    }
  }
  // 0 where the base does not hold the pair's.
  const auto held = [&](const mpm::BodyContact& pair) {
    for (std::size_t k = 0; k < base.contacts.size(); ++k) {
      if (same_pair(pair, base_scene.contacts[k])) return base.contacts[k];
    }
    for (const mpm::BodyContact& other : base.added) {
      if (same_pair(pair, other)) return other.contact.stiffness;
    }
    return 0.0;
  };
  for (std::size_t i = 0; i < frozen.contacts.size(); ++i) {
    const double stiffness = held(scene.contacts[i]);
    if (frozen.contacts[i] > 0.0 && stiffness > 0.0) frozen.contacts[i] = stiffness;
  }
  for (mpm::BodyContact& pair : frozen.added) {
    if (const double stiffness = held(pair); stiffness > 0.0) pair.contact.stiffness = stiffness;
  }
  if (frozen.walls > 0.0 && base.walls > 0.0) frozen.walls = base.walls;
}

std::vector<std::string> shared_contacts(const FrozenContacts& frozen, const mpm::Scene& scene,
                                         const std::vector<std::string>& fitted) {
  std::vector<std::string> sentences;
  const auto look_at = [&](const std::string& what, const mpm::Contact& contact, double held) {
    if (!(held > 0.0)) return;
    for (const mpm::Body& body : scene.bodies) {
      if (has_name(fitted, body.name)) continue;
      const double own = mpm::resolve_contact(contact, body, scene.dx).stiffness;
      double ratio = 1.0;
      widen(own, held, ratio);
      if (ratio < kOther) continue;
      sentences.push_back(fmt::format(
          "The stiffness of {} is held at {:.3g} Pa/m, what the fitted body asks for; alone, body "
          "'{}' would have {:.3g} Pa/m there, which matters if it touches it. A stiffness in the "
          "document settles it.",
          what, held, body.name, own));
    }
  };
  for (std::size_t i = 0; i < frozen.colliders.size(); ++i) {
    look_at("the contact with '" + scene.colliders[i]->name() + "'", scene.colliders[i]->contact(),
            frozen.colliders[i]);
  }
  if (scene.walls) look_at("the contact with the walls", scene.walls->contact, frozen.walls);
  return sentences;
}

void apply(const FrozenContacts& frozen, mpm::Scene& scene) {
  for (std::size_t i = 0; i < frozen.colliders.size(); ++i) {
    if (!(frozen.colliders[i] > 0.0)) continue;
    mpm::Contact contact = scene.colliders[i]->contact();
    contact.stiffness = frozen.colliders[i];
    scene.colliders[i] = with_contact(scene.colliders[i], contact);
  }
  for (std::size_t i = 0; i < frozen.contacts.size(); ++i) {
    if (frozen.contacts[i] > 0.0) scene.contacts[i].contact.stiffness = frozen.contacts[i];
  }
  scene.contacts.insert(scene.contacts.end(), frozen.added.begin(), frozen.added.end());
  if (scene.walls && frozen.walls > 0.0) scene.walls->contact.stiffness = frozen.walls;
}

void write(const FrozenContacts& frozen, Json& scene) {
  for (std::size_t i = 0; i < frozen.colliders.size(); ++i) {
    if (frozen.colliders[i] > 0.0) {
      scene["colliders"][i]["contact"]["stiffness"] = frozen.colliders[i];
    }
  }
  for (std::size_t i = 0; i < frozen.contacts.size(); ++i) {
    if (frozen.contacts[i] > 0.0) scene["contacts"][i]["stiffness"] = frozen.contacts[i];
  }
  for (const mpm::BodyContact& pair : frozen.added) {
    scene["contacts"].push_back(
        {{"bodies", {pair.first, pair.second}}, {"stiffness", pair.contact.stiffness}});
  }
  if (frozen.walls > 0.0) scene["walls"]["contact"]["stiffness"] = frozen.walls;
}

double largest_change(const FrozenContacts& a, const FrozenContacts& b) {
  double ratio = 1.0;
  for (std::size_t i = 0; i < std::min(a.colliders.size(), b.colliders.size()); ++i) {
    widen(a.colliders[i], b.colliders[i], ratio);
  }
  for (std::size_t i = 0; i < std::min(a.contacts.size(), b.contacts.size()); ++i) {
    widen(a.contacts[i], b.contacts[i], ratio);
  }
  for (std::size_t i = 0; i < std::min(a.added.size(), b.added.size()); ++i) {
    widen(a.added[i].contact.stiffness, b.added[i].contact.stiffness, ratio);
  }
  widen(a.walls, b.walls, ratio);
  return ratio;
}

}  // namespace matterfit::job
