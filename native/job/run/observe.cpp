// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/observe.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "capture/npz.hpp"
#include "job/run/build_scene.hpp"
#include "mpm/pin_region.hpp"

namespace matterfit::job {
namespace {

const Vec3d kUnknown = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());

capture::Array times_array(const std::vector<double>& times) {
  return capture::Array({times.size()}, std::vector<double>(times));
}

capture::Array positions_array(std::size_t frames, std::size_t points,
                               const std::vector<Vec3d>& positions) {
  std::vector<double> values;
  values.reserve(3 * positions.size());
  for (const Vec3d& x : positions) values.insert(values.end(), {x.x(), x.y(), x.z()});
  return capture::Array({frames, points, 3}, std::move(values));
}

capture::Array texts_array(std::vector<std::string> texts) {
  const std::size_t count = texts.size();
  return capture::Array({count}, std::move(texts));
}

Vec3d mean_of(const Vec3d* points, std::size_t count) {
  Vec3d sum = Vec3d::Zero();
  std::size_t used = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (!points[i].allFinite()) continue;
    sum += points[i];
    ++used;
  }
  return used == 0 ? kUnknown : Vec3d(sum / double(used));
}

}  // namespace

struct Observations::Follower {
  std::size_t body = 0;
  std::optional<fit::PointFollower> points;
  std::vector<Points> positions;      ///< of every frame, where kept
  std::vector<std::size_t> averaged;  ///< particles, in place of points that bind to them
  bool keeps_positions = false;       ///< of every point, beside the mean
  Points mean;                        ///< of every frame
};

Observations::~Observations() = default;

Observations::Observations(const Job& job, const mpm::Scene& scene,
                           const std::vector<fit::CaptureInput>& captures, Arena& arena)
    : job_(job), scene_(scene), captures_(captures), arena_(arena) {
  const double separation = 0.5 * scene.dx;
  const auto follow = [&](std::size_t body, fit::PointFollower points) {
    auto follower = std::make_unique<Follower>();
    follower->body = body;
    follower->points.emplace(std::move(points));
    followers_.push_back(std::move(follower));
  };
  for (const fit::CaptureInput& capture : captures) {
    const std::size_t body = fit::body_index(scene, capture.body);
    follow(body, {scene.bodies[body], capture, capture.rest, separation, arena});
    followers_.back()->keeps_positions = true;
  }
  for (std::size_t i = 0; i < job.probes.size(); ++i) {
    const std::size_t body = fit::body_index(scene, job.probes[i].body);
    follow(body, {scene.bodies[body], probe_points(job, i, scene), separation, arena});
  }
  if (!followers_.empty()) return;
  // Nothing asks for it, but a body that is let go may ring: the particles that no pin holds on to.
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (!body_release(job.scene.bodies[b], job.scene)) continue;
    const mpm::Body& body = scene.bodies[b];
    auto follower = std::make_unique<Follower>();
    follower->body = b;
    for (std::size_t p = 0; p < body.rest.size(); ++p) {
      const Vec3d& x = body.rest[p];
      const bool held = std::any_of(body.pins.begin(), body.pins.end(), [&](const mpm::Pin& pin) {
        return !std::isfinite(pin.release) && region_distance(pin, x).distance <= 0.0;
      });
      if (!held) follower->averaged.push_back(p);
    }
    if (!follower->averaged.empty()) followers_.push_back(std::move(follower));
    break;
  }
}

void Observations::record(const mpm::FrameState& state) {
  times_.push_back(state.time);
  for (const auto& follower : followers_) {
    if (!follower->averaged.empty()) {
      Vec3d sum = Vec3d::Zero();
      for (const std::size_t p : follower->averaged) {
        sum += state.bodies[follower->body].positions[p].cast<double>();
      }
      follower->mean.push_back(sum / double(follower->averaged.size()));
      continue;
    }
    Points all = follower->points->positions(scene_.bodies[follower->body],
                                             state.bodies[follower->body], arena_);
    follower->mean.push_back(mean_of(all.data(), all.size()));
    if (follower->keeps_positions) follower->positions.push_back(std::move(all));
  }
}

double Observations::farthest(std::size_t capture) const {
  return followers_[capture]->points->farthest();
}

fit::SimulatedCapture Observations::at_capture(std::size_t capture) const {
  const Follower& follower = *followers_[capture];
  return fit::at_times(follower.positions, follower.points->size(), captures_[capture].tracks.times,
                       scene_.fps);
}

std::optional<fit::Ringdown> Observations::capture_ringdown(std::size_t capture) const {
  if (!captures_[capture].release) return std::nullopt;
  return fit::fit_ringdown(times_, followers_[capture]->mean, *captures_[capture].release);
}

std::optional<fit::Ringdown> Observations::probe_ringdown(std::size_t probe) const {
  const Follower& follower = *followers_[captures_.size() + probe];
  const auto release = body_release(job_.scene.bodies[follower.body], job_.scene);
  if (!release) return std::nullopt;
  return fit::fit_ringdown(times_, follower.mean, *release);
}

std::optional<fit::Ringdown> Observations::body_ringdown() const {
  if (!captures_.empty() || !job_.probes.empty() || followers_.empty()) return std::nullopt;
  const Follower& follower = *followers_.front();
  const auto release = body_release(job_.scene.bodies[follower.body], job_.scene);
  if (!release) return std::nullopt;
  return fit::fit_ringdown(times_, follower.mean, *release);
}

std::vector<std::string> Observations::write(const std::filesystem::path& folder) const {
  std::vector<std::string> paths;
  for (std::size_t c = 0; c < captures_.size(); ++c) {
    const fit::SimulatedCapture simulated = at_capture(c);
    const fit::CaptureInput& capture = captures_[c];
    capture::Arrays arrays;
    // The file's own clock: times as the capture has them.
    std::vector<double> times = simulated.times;
    for (double& time : times) time -= capture.start;
    arrays["times"] = times_array(times);
    arrays["positions"] =
        positions_array(simulated.times.size(), capture.tracks.points, simulated.positions);
    arrays["captured"] =
        positions_array(simulated.times.size(), capture.tracks.points, capture.tracks.positions);
    std::vector<std::string> labels;
    for (std::size_t i = 0; i < capture.tracks.points; ++i) labels.push_back(capture.label(i));
    arrays["labels"] = texts_array(std::move(labels));
    paths.push_back(captures_.size() == 1 ? "simulated.npz" : "simulated_" + capture.name + ".npz");
    capture::write_npz(folder / paths.back(), arrays);
  }
  if (!job_.probes.empty()) {
    capture::Arrays arrays;
    arrays["times"] = times_array(times_);
    std::vector<std::string> names;
    std::vector<Points> motions;
    for (std::size_t i = 0; i < job_.probes.size(); ++i) {
      names.push_back(job_.probes[i].name);
      motions.push_back(followers_[captures_.size() + i]->mean);
    }
    std::vector<Vec3d> positions;
    for (std::size_t t = 0; t < times_.size(); ++t) {
      for (const Points& motion : motions) positions.push_back(motion[t]);
    }
    arrays["positions"] = positions_array(times_.size(), motions.size(), positions);
    arrays["names"] = texts_array(std::move(names));
    paths.emplace_back("probes.npz");
    capture::write_npz(folder / paths.back(), arrays);
  }
  return paths;
}

Points probe_points(const ProbeDoc& probe, const std::string& path, const mpm::Body& body,
                    double separation) {
  const mpm::Pin region = pin_region(probe.region);
  Points inside;
  std::vector<mpm::RegionDistance> outside;
  double least = std::numeric_limits<double>::infinity();
  for (const Vec3d& x : body.rest) {
    const mpm::RegionDistance distance = region_distance(region, x);
    if (distance.distance <= 0.0) {
      inside.push_back(x);
    } else {
      least = std::min(least, distance.distance);
      outside.push_back(distance);
    }
  }
  if (!inside.empty()) return inside;
  constexpr double kSlack = 1.01;
  // The last layer of a body that is no whole number of separations long stands up to a separation
  // off each of its faces.
  if (!(least <= kSlack * std::sqrt(3.0) * separation)) {
    throw_input(path + ".region: touches no particle of '" + body.name +
                "'. Regions are in world "
                "space, where the body starts.");
  }
  Points touching;
  for (const mpm::RegionDistance& distance : outside) {
    if (distance.distance <= kSlack * std::max(least, 0.5 * separation)) {
      touching.push_back(distance.nearest);
    }
  }
  return touching;
}

Points probe_points(const Job& job, std::size_t i, const mpm::Scene& scene) {
  const ProbeDoc& probe = job.probes[i];
  return probe_points(probe, "probes[" + std::to_string(i) + "]",
                      scene.bodies[fit::body_index(scene, probe.body)], 0.5 * scene.dx);
}

std::optional<fit::Ringdown> measured_ringdown(const fit::CaptureInput& capture) {
  if (!capture.release) return std::nullopt;
  Points means;
  for (std::size_t t = 0; t < capture.tracks.frames(); ++t) {
    bool all = true;
    for (std::size_t i = 0; i < capture.tracks.points; ++i) {
      all = all && capture.tracks.is_visible(t, i);
    }
    // A mean over changing points would jump; a frame in which one is hidden is left out.
    means.push_back(all ? mean_of(&capture.tracks.position(t, 0), capture.tracks.points)
                        : kUnknown);
  }
  return fit::fit_ringdown(capture.tracks.times, means, *capture.release);
}

}  // namespace matterfit::job
