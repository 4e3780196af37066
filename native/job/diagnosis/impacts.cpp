// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/impacts.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "job/diagnosis/extent.hpp"
#include "job/diagnosis/seen_tracks.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::job {
namespace {

using Eigen::Index;

/// Standard deviation of an impact's impulse, as a share of it: a corner of a block on the ground
/// at 9 to 20 cells across, over offsets and spacings, is off by .5 to 1.5 %, in its spin up to 2
/// %.
constexpr double kImpulseShare = 0.015;
/// Standard deviation of the time for which a body is held, in transits of a wave through it: how
/// a corner gives way depends on the elements or particles that it is made of.
constexpr double kHoldTransits = 0.05;
/// Accelerations beside gravity that count as contact, in gravities: a body at rest has 1.
constexpr double kContactGravities = 0.5;
/// How near a collider the nearest track is in contact, in the body's size. Tracks may be few.
constexpr double kNearCollider = 0.25;
/// Frames of contact that one correction is for.
constexpr int kFramesOfContact = 5;
constexpr std::size_t kMostImpacts = 6;
/// Standard deviations of the noise beyond which an acceleration is one.
constexpr double kAboveNoise = 4.0;

struct Placement {
  capture::RigidFit fit;
  std::size_t tracks = 0;
};

/// Placement of the body in a frame; nothing where too few tracks are seen.
std::optional<Placement> placement_in(const SeenTracks& samples, Index f) {
  const auto tracks = static_cast<std::size_t>(samples.capture.tracks());
  Points there(tracks, Vec3d::Zero());
  std::vector<double> weights(tracks, 0.0);
  std::size_t seen = 0;
  for (std::size_t i = 0; i < tracks; ++i) {
    if (!samples.seen(f, static_cast<Index>(i))) continue;
    there[i] = samples.at(f, static_cast<Index>(i));
    weights[i] = 1.0;
    ++seen;
  }
  if (seen < kFewestTracks) return std::nullopt;
  auto fit = placement_of(samples.capture.rest, there, weights);
  if (!fit) return std::nullopt;
  return Placement{std::move(*fit), seen};
}

bool near_collider(const SeenTracks& samples, Index f, const mpm::Scene& scene, double reach) {
  double least = std::numeric_limits<double>::infinity();
  const double time = samples.capture.times[static_cast<std::size_t>(f)];
  for (Index i = 0; i < samples.capture.tracks(); ++i) {
    if (!samples.seen(f, i)) continue;
    for (const shape::ColliderPtr& collider : scene.colliders) {
      least = std::min(least, collider->closest(samples.at(f, i), time).distance);
    }
  }
  return least < reach;
}

/// Change of the rigid velocity about one frame, beside what gravity does.
struct RateChange {
  bool known = false;
  bool contact = false;
  Vec3d velocity = Vec3d::Zero();  ///< [m/s]
  Vec3d spin = Vec3d::Zero();      ///< [rad/s]
};

std::vector<RateChange> rate_changes(const SeenTracks& samples, const mpm::Scene& scene,
                                     const mpm::Body& body) {
  const std::vector<double>& times = samples.capture.times;
  const auto frames = static_cast<Index>(times.size());
  const Extent extent = extent_of(body);
  const Vec3d& center = extent.center;
  std::vector<std::optional<Placement>> poses;
  for (Index f = 0; f < frames; ++f) poses.push_back(placement_in(samples, f));
  std::vector<RateChange> result(times.size());
  for (std::size_t f = 1; f + 1 < times.size(); ++f) {
    if (!poses[f - 1] || !poses[f] || !poses[f + 1]) continue;
    const auto velocity = [&](std::size_t a) -> Vec3d {
      return (poses[a + 1]->fit(center) - poses[a]->fit(center)) / (times[a + 1] - times[a]);
    };
    const auto spin = [&](std::size_t a) -> Vec3d {
      const Eigen::AngleAxisd turn(poses[a + 1]->fit.rotation * poses[a]->fit.rotation.transpose());
      return turn.angle() / (times[a + 1] - times[a]) * turn.axis();
    };
    const double span = 0.5 * (times[f + 1] - times[f - 1]);
    RateChange& change = result[f];
    change.known = true;
    change.velocity = velocity(f) - velocity(f - 1) - span * scene.gravity.at(times[f]);
    change.spin = spin(f) - spin(f - 1);
  }
  // What rings from frame to frame is not pushed: means over three frames are looked at.
  std::vector<RateChange> means(times.size());
  for (std::size_t f = 1; f + 1 < times.size(); ++f) {
    if (!result[f].known) continue;
    Vec3d velocity = 0.5 * result[f].velocity;
    Vec3d spin = 0.5 * result[f].spin;
    double weight = 0.5;
    for (const std::size_t beside : {f - 1, f + 1}) {
      if (!result[beside].known) continue;
      velocity += 0.25 * result[beside].velocity;
      spin += 0.25 * result[beside].spin;
      weight += 0.25;
    }
    means[f].velocity = velocity / weight;
    means[f].spin = spin / weight;
    const double span = 0.5 * (times[f + 1] - times[f - 1]);
    const double pushed =
        kContactGravities * std::max(scene.gravity.at(times[f]).norm(), 1.0) * span;
    // The noise of means over three frames of second differences of the tracks' mean.
    const double noise = kAboveNoise * samples.capture.noise * std::sqrt(3.0 * 0.375) /
                         (std::sqrt(double(poses[f]->tracks)) * span);
    means[f].contact =
        means[f].velocity.norm() > std::max(pushed, noise) &&
        near_collider(samples, static_cast<Index>(f), scene, kNearCollider * extent.size);
  }
  return means;
}

}  // namespace

std::vector<Impact> impacts(const diagnose::Capture& capture, const mpm::Scene& scene,
                            std::size_t run, std::size_t body) {
  const mpm::Body& struck = scene.bodies[body];
  if (scene.colliders.empty() || !struck.pins.empty() || !mpm::is_total(struck)) return {};
  const SeenTracks samples{capture};
  const std::vector<RateChange> seen = rate_changes(samples, scene, struck);
  const double size = extent_of(struck).size;
  const double held = kHoldTransits * size / struck.material.wave_speed(struck.density);
  std::vector<Impact> result;
  for (std::size_t begin = 0; begin < seen.size();) {
    if (!seen[begin].contact) {
      ++begin;
      continue;
    }
    std::size_t end = begin;
    while (end < seen.size() && seen[end].contact) ++end;
    const std::size_t parts = (end - begin + kFramesOfContact - 1) / kFramesOfContact;
    for (std::size_t k = 0; k < parts; ++k) {
      const std::size_t from = begin + (end - begin) * k / parts;
      const std::size_t to = begin + (end - begin) * (k + 1) / parts;
      Impact impact;
      impact.run = run;
      impact.body = body;
      impact.capture = &capture;
      impact.begin = static_cast<Index>(from);
      impact.end = static_cast<Index>(to);
      // The first frame of the scene that begins after it.
      impact.frame =
          scene.first_frame + static_cast<int>(std::ceil(capture.times[to - 1] * scene.fps - 1e-6));
      double velocity = 0.0;
      double spin = 0.0;
      for (std::size_t f = from; f < to; ++f) {
        velocity += seen[f].velocity.norm();
        spin += seen[f].spin.norm();
      }
      impact.speed = kImpulseShare * velocity;
      impact.turn = kImpulseShare * spin;
      impact.place = held * velocity;
      impact.angle = held * spin;
      // A hit in the middle turns a body hardly, but may as well do so.
      impact.turn += impact.speed / size;
      const bool taken = !result.empty() && result.back().frame >= impact.frame;
      if (!taken && impact.frame + 1 < scene.end_frame) result.push_back(impact);
    }
    begin = end;
  }
  if (result.size() > kMostImpacts) result.resize(kMostImpacts);
  return result;
}

}  // namespace matterfit::job
