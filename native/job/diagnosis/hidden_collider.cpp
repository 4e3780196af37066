// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/hidden_collider.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "job/diagnosis/extent.hpp"
#include "job/diagnosis/seen_tracks.hpp"
#include "shape/collider.hpp"

namespace matterfit::job {
namespace {

using Eigen::Index;

/// How far above the median of all frames an encounter's missing acceleration is.
constexpr double kFarAbove = 6.0;
/// What counts as a usual one at least, in the largest.
constexpr double kOfLargest = 0.02;
constexpr std::size_t kMost = 2;
/// Frames beside an encounter that belong to it.
constexpr int kNeighbours = 2;
constexpr std::size_t kFewestFrames = 5;
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

struct Samples : SeenTracks {
  const Eigen::VectorXd& simulated;
  Index first;  ///< of the capture's rows

  [[nodiscard]] Vec3d simulated_at(Index f, Index i) const {
    return simulated.segment<3>(first + 3 * (f * capture.tracks() + i));
  }
};

/// At a frame.
struct Missing {
  Index frame = 0;
  Vec3d acceleration = Vec3d::Zero();  ///< measured − simulated, mean of the tracks [m/s²]
  double own = 0.0;                    ///< size of the simulated one beyond gravity
};

std::vector<Missing> missing_accelerations(const Samples& samples, const Vec3d& gravity) {
  const std::vector<double>& times = samples.capture.times;
  std::vector<Missing> result;
  for (Index f = 1; f + 1 < static_cast<Index>(times.size()); ++f) {
    const auto at = static_cast<std::size_t>(f);
    const double before = times[at] - times[at - 1];
    const double after = times[at + 1] - times[at];
    const auto second = [&](const Vec3d& a, const Vec3d& b, const Vec3d& c) -> Vec3d {
      return 2.0 / (before + after) * ((c - b) / after - (b - a) / before);
    };
    Missing missing;
    missing.frame = f;
    Vec3d own = Vec3d::Zero();
    double count = 0.0;
    for (Index i = 0; i < samples.capture.tracks(); ++i) {
      if (!samples.used(f - 1, i) || !samples.used(f, i) || !samples.used(f + 1, i)) continue;
      const Vec3d simulated = second(samples.simulated_at(f - 1, i), samples.simulated_at(f, i),
                                     samples.simulated_at(f + 1, i));
      missing.acceleration +=
          second(samples.at(f - 1, i), samples.at(f, i), samples.at(f + 1, i)) - simulated;
      own += simulated - gravity;
      count += 1.0;
    }
    if (!(count > 0.0)) continue;
    missing.acceleration /= count;
    missing.own = own.norm() / count;
    result.push_back(missing);
  }
  return result;
}

Encounter encounter_at(const Samples& samples, const Missing& missing) {
  Encounter found;
  found.normal = missing.acceleration.normalized();
  // The frame before may have seen the beginning.
  found.time = samples.capture.times[static_cast<std::size_t>(missing.frame - 1)];
  double nearest = 1e300;
  double passed = 1e300;
  for (Index f = 0; f < static_cast<Index>(samples.capture.times.size()); ++f) {
    for (Index i = 0; i < samples.capture.tracks(); ++i) {
      if (!samples.used(f, i)) continue;
      passed = std::min(passed, samples.simulated_at(f, i).dot(found.normal));
      if (std::abs(f - missing.frame) > 1) continue;
      const double along = samples.at(f, i).dot(found.normal);
      if (along < nearest) {
        nearest = along;
        found.point = samples.at(f, i);
      }
    }
  }
  // One that was fitted to before and after together may turn earlier.
  found.reach = std::max(0.0, nearest - passed);
  return found;
}

}  // namespace

std::vector<Encounter> encounters(const std::vector<diagnose::Capture>& captures,
                                  const Eigen::VectorXd& simulated, const Vec3d& gravity) {
  std::vector<std::pair<double, Encounter>> found;
  Index first = 0;
  for (const diagnose::Capture& capture : captures) {
    const Samples samples{{capture}, simulated, first};
    first += 3 * capture.samples();
    std::vector<Missing> missing = missing_accelerations(samples, gravity);
    if (missing.size() < kFewestFrames) continue;
    std::ranges::stable_sort(missing, std::greater<>(),
                             [](const Missing& m) { return m.acceleration.norm(); });
    const double usual = std::max(missing[missing.size() / 2].acceleration.norm(),
                                  kOfLargest * missing.front().acceleration.norm());
    std::vector<Index> taken;
    for (const Missing& m : missing) {
      const double size = m.acceleration.norm();
      if (size < kFarAbove * usual || taken.size() >= kMost) break;
      if (size < m.own) continue;
      if (std::ranges::any_of(taken, [&](Index f) { return std::abs(f - m.frame) <= kNeighbours; }))
        continue;
      taken.push_back(m.frame);
      found.emplace_back(size / std::max(usual, 1e-12), encounter_at(samples, m));
    }
  }
  std::ranges::stable_sort(found, std::greater<>(), [](const auto& f) { return f.first; });
  if (found.size() > kMost) found.resize(kMost);
  std::vector<Encounter> result;
  result.reserve(found.size());
  for (const auto& [clear, encounter] : found) result.push_back(encounter);
  return result;
}

std::optional<Cause> hidden_collider(const std::vector<Encounter>& encounters,
                                     const mpm::Scene& scene) {
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
