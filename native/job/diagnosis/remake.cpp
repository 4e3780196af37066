// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/remake.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "job/diagnosis/extent.hpp"
#include "shape/collider.hpp"

namespace matterfit::job {
namespace {

/// A throw by hand, over what there is [m/s].
constexpr double kThrow = 3.0;
/// A spin by hand [rad/s].
constexpr double kSpin = 10.0;
/// From so many body sizes higher, at least half a metre.
constexpr double kHigher = 2.0;
constexpr double kLeastHigher = 0.5;
/// Longer by so much.
constexpr double kLonger = 2.0;

bool is_held(const mpm::Body& body) { return !body.pins.empty(); }

/// Level, across the way that a body is thrown.
Vec3d sideways(const Vec3d& velocity) {
  const Vec3d across = Vec3d::UnitZ().cross(velocity);
  return across.norm() > 1e-3 ? Vec3d(across.normalized()) : Vec3d(Vec3d::UnitX());
}

}  // namespace

std::vector<Remake> remakes_of(const mpm::Scene& scene, std::size_t body,
                               const std::vector<std::string>& grounds) {
  const mpm::Body& thrown = scene.bodies[body];
  std::vector<Remake> result;
  if (is_held(thrown)) {
    if (scene.colliders.empty()) {
      Remake turned{.name = "turned", .sentence = "Hold it turned on its side, a quarter turn."};
      turned.turn = Eigen::AngleAxisd(std::numbers::pi / 2.0, Vec3d::UnitX());
      result.push_back(turned);
    }
  } else {
    const Vec3d across = sideways(thrown.velocity);
    result.push_back({.name = "sideways",
                      .sentence = fmt::format("Throw it sideways, by about {:.2g} m/s.", kThrow),
                      .velocity = kThrow * across});
    result.push_back({.name = "upwards",
                      .sentence = fmt::format("Throw it upwards, by about {:.2g} m/s.", kThrow),
                      .velocity = kThrow * Vec3d::UnitZ()});
    result.push_back({.name = "spin",
                      .sentence = fmt::format("Throw it with a spin of about {:.2g} rad/s.", kSpin),
                      .spin = kSpin * across});
    const bool open = std::ranges::all_of(scene.colliders, [&](const shape::ColliderPtr& collider) {
      return std::ranges::count(grounds, collider->name()) > 0;
    });
    if (open && !scene.colliders.empty()) {
      const double higher = std::max(kLeastHigher, kHigher * extent_of(thrown).size);
      result.push_back({.name = "higher",
                        .sentence = fmt::format("Let it fall from {:.2g} m higher.", higher),
                        .higher = higher});
    }
  }
  result.push_back({.name = "longer",
                    .sentence = fmt::format("Record it for {:.2g} times as long.", kLonger),
                    .duration = kLonger});
  return result;
}

void remake(const Remake& other, std::size_t body, mpm::Scene& scene) {
  scene.bodies[body].velocity += other.velocity;
  scene.bodies[body].spin += other.spin;
  // The world is turned and lowered in place of the body, whose points stay where they are.
  for (Vec3d& gravity : scene.gravity.values) gravity = other.turn.conjugate() * gravity;
  if (other.higher > 0.0) {
    for (shape::ColliderPtr& collider : scene.colliders) {
      const shape::SurfacePoint foot = collider->closest(Vec3d::Zero(), 0.0);
      collider = shape::make_plane(collider->name(), collider->contact(),
                                   -foot.distance * foot.normal - other.higher * Vec3d::UnitZ(),
                                   foot.normal);
    }
  }
  const int frames = scene.end_frame - 1 - scene.first_frame;
  scene.end_frame = scene.first_frame + 1 + static_cast<int>(std::lround(other.duration * frames));
}

}  // namespace matterfit::job
