// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/variation.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/error.hpp"
#include "effects/effect_type.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::fit {
namespace {

/// A collider somewhere else.
class Moved final : public shape::Collider {
 public:
  Moved(shape::ColliderPtr surface, const Vec3d& by)
      : shape::Collider(surface->name(), surface->contact()),
        surface_(std::move(surface)),
        by_(by) {}

  [[nodiscard]] shape::SurfacePoint closest(const Vec3d& position, double time) const override {
    return surface_->closest(position - by_, time);
  }
  [[nodiscard]] double band() const override { return surface_->band(); }
  [[nodiscard]] bool animated() const override { return surface_->animated(); }

 private:
  shape::ColliderPtr surface_;
  Vec3d by_;
};

void move_pin(mpm::Pin& pin, const Vec3d& by) {
  pin.point += by;
  pin.low += by;
  pin.high += by;
  pin.pivot += by;
  for (Vec3d& x : pin.points) x += by;
}

void move_effect(effects::Effect& effect, const Vec3d& by) {
  const auto center = effect.type->find("center");
  if (!center) return;
  const std::size_t first = effect.type->offset(*center);
  effects::add_vector(by, effect.values.data() + first);
  for (std::size_t c = 0; c < 3; ++c) {
    if (!effect.keyed(first + c)) continue;
    for (double& value : effect.keys[first + c].values) value += by[static_cast<int>(c)];
  }
}

}  // namespace

void move_world(const Vec3d& by, mpm::Scene& scene) {
  for (mpm::Body& body : scene.bodies) {
    place(body, Vec3d::Zero(), by, Quatd::Identity());
    for (mpm::Pin& pin : body.pins) move_pin(pin, by);
    for (mpm::AttachedMass& mass : body.masses) mass.position += by;
  }
  for (shape::ColliderPtr& collider : scene.colliders) {
    collider = std::make_shared<Moved>(collider, by);
  }
  for (effects::Effect& effect : scene.effects) move_effect(effect, by);
  if (scene.walls) {
    scene.walls->low += by;
    scene.walls->high += by;
  }
}

namespace {

/// Whether an assignment is about this run at all.
bool is_of(const Assignment& assignment, const Run& run) {
  const std::string& name = assignment.at.capture;
  if (name.empty()) return true;
  return run.own && std::any_of(run.captures.begin(), run.captures.end(),
                                [&](const Capture& capture) { return capture.input.name == name; });
}

void assign(const Assignment& assignment, const Run& run, mpm::Scene& scene) {
  const Address& at = assignment.at;
  if (at.component || !at.quantity->is_vector()) {
    write(assignment.value, at, scene, run.origins);
  } else {
    write(Components{assignment.value, assignment.value, assignment.value}, at, scene, run.origins);
  }
}

}  // namespace

void vary(const Variation& variation, const Run& run, mpm::Scene& scene) {
  for (const Assignment& assignment : variation.set) {
    if (assignment.at.quantity->owner == Owner::kCapture || !is_of(assignment, run)) continue;
    const auto owner = bearer(scene, assignment.at);
    if (!owner) continue;
    if (const std::string why = obstacle(assignment.at, *owner); !why.empty()) {
      throw_input("'" + assignment.at.text() + "' cannot be set: " + why);
    }
    assign(assignment, run, scene);
  }
  const double factor = variation.dt_factor;
  if (!(factor > 0.0) || factor > 1.0) {
    throw_input("a substep cannot be " + std::to_string(factor) +
                " times as long: expected a factor above 0, at most 1.");
  }
  scene.dt *= factor;
  scene.dt_safety *= factor;
  scene.cfl *= factor;
  scene.grid_shift += variation.grid_shift;
  const Vec3d by = world_shift(variation.grid_shift, scene);
  if (!by.isZero(0.0)) move_world(by, scene);
}

void vary_places(const Variation& variation, const Run& run, mpm::Scene& scene) {
  for (const Assignment& assignment : variation.set) {
    if (!assignment.at.quantity->places() || !is_of(assignment, run)) continue;
    if (bearer(scene, assignment.at)) assign(assignment, run, scene);
  }
}

Viewing varied(const Variation& variation, const Run& run, std::size_t capture, Viewing viewing) {
  for (const Assignment& assignment : variation.set) {
    const Access& access = assignment.at.quantity->access;
    if (access.set_view == nullptr || !is_of(assignment, run)) continue;
    if (assignment.at.owner == run.captures[capture].input.name) {
      access.set_view(assignment.value, assignment.at, viewing);
    }
  }
  return viewing;
}

bool places(const Variation& variation, const mpm::Body& body) {
  return std::any_of(variation.set.begin(), variation.set.end(), [&](const Assignment& one) {
    return one.at.quantity->places() && one.at.owner == body.name;
  });
}

Vec3d world_shift(const Vec3d& cells, const mpm::Scene& scene) {
  const bool updated = !std::all_of(scene.bodies.begin(), scene.bodies.end(), mpm::is_total);
  return updated ? Vec3d(scene.dx * cells) : Vec3d(Vec3d::Zero());
}

}  // namespace matterfit::fit
