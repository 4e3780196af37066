// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/capture_noise.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "capture/binding.hpp"
#include "capture/check.hpp"
#include "fit/data/capture_marks.hpp"
#include "fit/data/follow.hpp"
#include "fit/data/metrics.hpp"

namespace matterfit::fit {
namespace {

/// The share of a capture's points that may lie off the body.
constexpr double kStray = 0.05;
constexpr double kStrayDistance = 2.0;  // particle separations
constexpr double kOtherBody = 0.25;     // of the body's size
constexpr double kDefaultNoise = 1e-3;  // of the body's size

}  // namespace

void settle_noise(std::vector<Capture>& captures, const mpm::Scene& scene,
                  std::vector<std::string>& statements) {
  for (Capture& capture : captures) {
    const CaptureInput& input = capture.input;
    capture.sigma = input.tracks.noise;
    if (capture.sigma.size() != input.tracks.points) {
      capture.sigma.assign(input.tracks.points,
                           capture.sigma.size() == 1 ? capture.sigma.front() : 0.0);
    }
    std::vector<std::size_t> missing;
    for (std::size_t i = 0; i < input.tracks.points; ++i) {
      if (!(capture.sigma[i] > 0.0)) missing.push_back(i);
    }
    if (missing.empty()) continue;
    const mpm::Body& body = scene.bodies[body_index(scene, input.body)];
    const double fallback = kDefaultNoise * body_size(body.rest);
    // Its differences over time tell nothing of clouds, whose points change from frame to frame.
    const bool told = capture.used_count > 0 && !capture.clouds;
    const double estimate = told ? capture::summarise(visible_to_fit(capture)).noise : 0.0;
    const double noise = estimate > 0.0 ? estimate : fallback;
    for (const std::size_t i : missing) capture.sigma[i] = noise;
    if (capture.used_count == 0) continue;
    const std::string given =
        missing.size() == input.tracks.points
            ? "no noise is given"
            : "the noise of " + named_points(input, missing) + " is given as 0";
    const std::string taken =
        estimate > 0.0 ? fmt::format("its own estimate is {:.3g} mm.", 1e3 * noise)
        : capture.clouds
            ? fmt::format(
                  "without correspondence it cannot be estimated; {:.3g} mm is taken, a thousandth "
                  "of the body's size.",
                  1e3 * noise)
            : fmt::format(
                  "none can be estimated; {:.3g} mm is taken, a thousandth of the body's size.",
                  1e3 * noise);
    const char* link = estimate > 0.0 || capture.clouds ? "; " : " and ";
    statements.push_back(fmt::format("captures.{}: {}{}{}", input.name, given, link, taken));
  }
}

void describe_clouds(const std::vector<Capture>& captures, std::vector<std::string>& statements) {
  for (const Capture& capture : captures) {
    if (!capture.clouds || capture.used_count == 0) continue;
    const CloudScale scale = capture.cloud_scale();
    statements.push_back(fmt::format(
        "captures.{}: clouds are compared by means over a radius of {:.3g} mm. By these two "
        "samplings of the same body miss each other by {:.3g} mm: an error is to be seen against "
        "that.",
        capture.input.name, 1e3 * scale.reach, 1e3 * mean_length(scale.sigma)));
  }
}

void check_places(const std::vector<Capture>& captures, const mpm::Scene& scene, Arena& arena,
                  std::vector<std::string>& statements) {
  const double separation = 0.5 * scene.dx;
  for (const Capture& capture : captures) {
    // A cloud that begins in the middle of the motion says nothing of the body at rest.
    if (capture.input.front) continue;  // no place on the body
    const capture::Tracks& tracks = capture.input.tracks;
    const std::size_t first = first_frame(tracks);
    if (capture.clouds && first < tracks.frames() &&
        tracks.times[first] > kFrameSlack / scene.fps) {
      continue;
    }
    Points places;
    for (std::size_t i = 0; i < capture.input.rest.size(); ++i) {
      if (capture.input.held_out_points[i] == 0 && capture.input.rest[i].allFinite()) {
        places.push_back(capture.input.rest[i]);
      }
    }
    if (places.empty()) continue;
    const mpm::Body& body = scene.bodies[body_index(scene, capture.input.body)];
    const capture::MeshBinding binding(places, body.rest, separation, {}, arena);
    const std::size_t stray = binding.count_beyond(kStrayDistance * separation);
    if (double(stray) <= kStray * double(places.size())) continue;
    const double size = body_size(body.rest) + separation;
    const std::size_t far =
        binding.count_beyond(std::max(kStrayDistance * separation, kOtherBody * size));
    const std::string lie =
        fmt::format("{} of {} points lie farther than {:.3g} mm off '{}' at rest", far,
                    places.size(), 1e3 * kOtherBody * size, body.name);
    if (double(far) > kStray * double(places.size())) {
      throw_input(
          capture.path + ": " + lie +
          fmt::format(", up to {:.3g} m. Is it a capture of another body? Look at body, unit, up, "
                      "transform and start_frame.",
                      binding.farthest().distance));
    }
    statements.push_back(
        "captures." + capture.input.name +
        fmt::format(
            ": {} of {} points lie farther than two particle separations ({:.3g} mm) off '{}' at "
            "rest, up to {:.3g} mm. Markers that stand off the body are carried along; if they do "
            "not, this may be a capture of another body, or its unit or transform is wrong.",
            stray, places.size(), 1e3 * kStrayDistance * separation, body.name,
            1e3 * binding.farthest().distance));
  }
}

}  // namespace matterfit::fit
