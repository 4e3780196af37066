// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/hidden_collider.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "job/diagnosis/extent.hpp"
#include "shape/collider.hpp"

namespace matterfit::job {
namespace {

/// Radii of spheres that are tried, in longest sides of the body.
constexpr std::array<double, 2> kRadii = {0.5, 1.5};
constexpr double kLeastReach = 0.25;
constexpr double kFriction = 0.3;  ///< that a search begins with
constexpr double kMostFriction = 2.0;
constexpr double kMostTilt = 0.8;  // [rad]
constexpr const char* kName = "hidden collider";

/// What a cause's numbers are.
enum : std::size_t { kReach, kTilt1, kTilt2, kMu, kNumbers };

/// A shape that may be in the way.
struct Shape {
  Encounter encounter;
  double radius;  ///< 0: a plane
  double seen;    ///< reach at which its surface lies where the body was seen to turn [m]
};

/// Where it lies: its surface's point nearest to the body, and the normal there. The impulse that
/// showed it holds its friction too, so the normal may be tilted from it.
struct Lie {
  Vec3d point;
  Vec3d normal;

  Lie(const Shape& shape, std::span<const double> v) {
    const Vec3d& n = shape.encounter.normal;
    const Vec3d first = n.unitOrthogonal();
    const Vec3d across = v[kTilt1] * first + v[kTilt2] * n.cross(first);
    const double angle = across.norm();
    normal = angle > 0.0 ? Vec3d(std::cos(angle) * n + std::sin(angle) / angle * across) : n;
    point = shape.encounter.point + (v[kReach] - shape.seen) * normal;
  }
};

std::vector<diagnose::Number> numbers_of(double size) {
  std::vector<diagnose::Number> numbers(kNumbers);
  diagnose::Number& reach = numbers[kReach];
  reach.name = "reach";
  reach.unit = "m";
  reach.scale = 0.05 * size;
  reach.low = 0.0;
  reach.one_sided = true;
  for (const std::size_t k : {kTilt1, kTilt2}) {
    numbers[k].name = k == kTilt1 ? "tilt_1" : "tilt_2";
    numbers[k].unit = "rad";
    numbers[k].scale = 0.1;
    numbers[k].low = -kMostTilt;
    numbers[k].high = kMostTilt;
  }
  diagnose::Number& mu = numbers[kMu];
  mu.name = "friction";
  mu.scale = 0.1;
  mu.first_step = kFriction;
  mu.low = 0.0;
  mu.one_sided = true;
  mu.high = kMostFriction;
  return numbers;
}

}  // namespace

std::optional<Cause> hidden_collider(const std::vector<Encounter>& all, const mpm::Scene& scene) {
  std::vector<Encounter> encounters;
  std::ranges::copy_if(all, std::back_inserter(encounters),
                       [](const Encounter& encounter) { return !(encounter.lasts > 0.0); });
  if (encounters.empty()) return std::nullopt;
  const double size = extent_of(scene.bodies.front()).size;
  Cause cause;
  cause.row.name = "hidden_collider";
  cause.row.scope = "shared";
  cause.row.group = "contact";
  cause.row.sentence =
      "Something that the scene does not have is in the way, {value} into where the body would "
      "pass: {variant}.";
  cause.row.confused_with = {"force_field", "moving_collider"};
  std::vector<Shape> shapes;
  cause.row.numbers = numbers_of(size);
  diagnose::Number& reach = cause.row.numbers[kReach];
  for (const Encounter& encounter : encounters) {
    // The fitted path is one of before and after together: it may only just reach there.
    reach.first_step = std::max({reach.first_step, encounter.reach, kLeastReach * size});
  }
  reach.high = reach.first_step + size;
  for (const Encounter& encounter : encounters) {
    const auto add = [&](double radius, const std::string& what) {
      shapes.push_back({encounter, radius, reach.first_step});
      cause.row.onsets.push_back(encounter.time);
      cause.row.variants.push_back(
          fmt::format("{} met after {:.3g} s at ({:.3g}, {:.3g}, {:.3g}) m", what, encounter.time,
                      encounter.point.x(), encounter.point.y(), encounter.point.z()));
    };
    add(0.0, "a wall");
    if (&encounter != &encounters.front()) continue;
    for (const double radius : kRadii) {
      add(radius * size, fmt::format("a ball of {:.2g} m radius", radius * size));
    }
  }
  cause.apply = [shapes](std::span<const double> v, int variant, mpm::Scene& scene) {
    if (!(v[kReach] > 0.0)) return;
    const Shape& shape = shapes[static_cast<std::size_t>(variant)];
    shape::Contact contact;
    contact.mu = v[kMu];
    const auto [point, normal] = Lie(shape, v);
    if (shape.radius > 0.0) {
      shape::Pose pose;
      pose.position = point - shape.radius * normal;
      scene.colliders.push_back(
          shape::make_sphere(kName, contact, shape.radius, shape::Keyed<shape::Pose>(pose)));
    } else {
      scene.colliders.push_back(shape::make_plane(kName, contact, point, normal));
    }
  };
  cause.write = [shapes](std::span<const double> v, int variant, Json& scene) {
    const Shape& shape = shapes[static_cast<std::size_t>(variant)];
    const auto [point, normal] = Lie(shape, v);
    Json collider = {{"name", kName}, {"contact", {{"kind", "friction"}, {"mu", v[kMu]}}}};
    if (shape.radius > 0.0) {
      const Vec3d center = point - shape.radius * normal;
      collider["shape"] = "sphere";
      collider["radius"] = shape.radius;
      collider["transform"] = {{"position", {center.x(), center.y(), center.z()}}};
    } else {
      collider["shape"] = "plane";
      collider["point"] = {point.x(), point.y(), point.z()};
      collider["normal"] = {normal.x(), normal.y(), normal.z()};
    }
    scene["colliders"].push_back(std::move(collider));
  };
  return cause;
}

}  // namespace matterfit::job
