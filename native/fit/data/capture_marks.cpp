// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/capture_marks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "capture/check.hpp"

namespace matterfit::fit {
namespace {

/// A body whose points have moved by less than this, root mean square, has not: of points at rest
/// the noise makes it √6.
constexpr double kStill = 3.0;  // times the noise
constexpr std::size_t kMostNamed = 6;

/// The frame in which the point is seen first.
std::size_t first_seen(const capture::Tracks& tracks, std::size_t point) {
  for (std::size_t t = 0; t < tracks.frames(); ++t) {
    if (tracks.is_visible(t, point)) return t;
  }
  return tracks.frames();
}

/// Until when the body is where it starts [s]: its release, or the capture's first frame and those
/// after it over which nothing has moved by more than the noise.
double still_until(const Capture& capture) {
  const capture::Tracks& all = capture.input.tracks;
  const std::size_t first = first_frame(all);
  double until = first < all.frames() ? all.times[first] : 0.0;
  if (capture.input.release) until = std::max(until, *capture.input.release);
  if (first == all.frames() || capture.clouds) return until;
  const capture::Tracks tracks = visible_to_fit(capture);
  double noise = 0.0;
  for (const double sigma : tracks.noise) noise = std::max(noise, sigma);
  if (!(noise > 0.0)) noise = capture::summarise(tracks).noise;
  for (std::size_t t = first + 1; t < tracks.frames(); ++t) {
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < tracks.points; ++i) {
      if (!tracks.is_visible(first, i) || !tracks.is_visible(t, i)) continue;
      squares += (tracks.position(t, i) - tracks.position(first, i)).squaredNorm();
      count += 1.0;
    }
    if (count == 0.0 || squares > kStill * kStill * noise * noise * count) break;
    until = std::max(until, tracks.times[t]);
  }
  return until;
}

}  // namespace

capture::Tracks visible_to_fit(const Capture& capture) {
  capture::Tracks tracks = capture.input.tracks;
  const std::size_t points = tracks.points;
  if (tracks.visible.empty()) tracks.visible.assign(tracks.frames() * points, 1);
  for (std::size_t t = 0; t < tracks.frames(); ++t) {
    for (std::size_t i = 0; i < points; ++i) {
      if (capture.held_out(t, i)) tracks.visible[t * points + i] = 0;
    }
  }
  return tracks;
}

std::size_t first_frame(const capture::Tracks& tracks) {
  std::size_t first = tracks.frames();
  for (std::size_t i = 0; i < tracks.points; ++i) {
    first = std::min(first, first_seen(tracks, i));
  }
  return first;
}

std::string named_points(const CaptureInput& input, const std::vector<std::size_t>& points) {
  std::string text = fmt::format("{} of its {} points (", points.size(), input.tracks.points);
  for (std::size_t k = 0; k < std::min(points.size(), kMostNamed); ++k) {
    text += (k == 0 ? "" : ", ") + input.label(points[k]);
  }
  return text + (points.size() > kMostNamed ? ", …)" : ")");
}

void leave_out_late(Capture& capture, double slack, std::vector<std::string>& statements) {
  CaptureInput& input = capture.input;
  if (capture.places_given) return;
  const std::size_t earliest = first_frame(input.tracks);
  std::vector<std::size_t> later;  // than the first frame
  for (std::size_t i = 0; i < input.tracks.points; ++i) {
    const std::size_t first = first_seen(input.tracks, i);
    if (first != earliest && first != input.tracks.frames()) later.push_back(i);
  }
  if (later.empty()) return;
  const double until = still_until(capture);
  std::vector<std::size_t> late;
  for (const std::size_t i : later) {
    if (input.tracks.times[first_seen(input.tracks, i)] <= until + slack) continue;
    input.rest[i] = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());
    late.push_back(i);
  }
  if (late.empty() || capture.clouds) return;
  statements.push_back(
      "captures." + input.name + ": " + named_points(input, late) +
      " are seen first when the body moves, so where they belong on it is not known; they are left "
      "out. To use them give 'positions'.");
}

void hold_out_unknown(Capture& capture, double slack, std::vector<std::string>& statements) {
  CaptureInput& input = capture.input;
  if (capture.places_given || capture.clouds) return;
  std::vector<std::size_t> unknown;
  std::size_t points = 0;
  std::string frames;
  for (std::size_t i = 0; i < input.tracks.points; ++i) {
    if (input.held_out_points[i] != 0 || !input.rest[i].allFinite()) continue;
    const std::size_t first = first_seen(input.tracks, i);
    if (first == input.tracks.frames()) continue;
    ++points;
    bool seen = input.held_out_frames[first] == 0;
    const bool quiet = input.release && input.tracks.times[first] <= *input.release + slack;
    for (std::size_t t = first; quiet && t < input.tracks.frames(); ++t) {
      if (input.tracks.times[t] > *input.release + slack) break;
      seen = seen || (input.tracks.is_visible(t, i) && input.held_out_frames[t] == 0);
    }
    if (seen) continue;
    unknown.push_back(i);
    frames = quiet ? "all frames before the release" : "the first frames";
  }
  if (unknown.empty()) return;
  if (unknown.size() == points) {
    throw_input(capture.path + ".holdout.frames: holds out " + frames +
                ", which say where the points are on the body. Hold out later frames, or give "
                "'positions'.");
  }
  for (const std::size_t i : unknown) input.held_out_points[i] = 1;
  statements.push_back("captures." + input.name + ": " + named_points(input, unknown) +
                       " are seen at rest in held-out frames only; they are held out.");
}

void mark_used(Capture& capture, const Clock& clock) {
  const CaptureInput& input = capture.input;
  const capture::Tracks& tracks = input.tracks;
  const double slack = kFrameSlack / clock.fps;
  const double last = clock.end();
  const std::size_t points = tracks.points;
  const std::size_t earliest = first_frame(tracks);
  capture.used.assign(tracks.frames() * points, 0);
  capture.predicted = capture.used;
  capture.begin = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points; ++i) {
    if (!input.rest[i].allFinite() && !capture.clouds) continue;
    const std::size_t first = capture.clouds ? earliest : first_seen(tracks, i);
    if (first == tracks.frames()) continue;
    // Until then the point is at rest by definition: such samples say nothing.
    double rest = tracks.times[first];
    if (input.release) rest = std::max(rest, *input.release);
    if (capture.places_given && !input.release) rest = -std::numeric_limits<double>::infinity();
    if (input.held_out_points[i] == 0) {
      capture.begin = std::min(capture.begin, std::max(0.0, rest));
    }
    for (std::size_t t = 0; t < tracks.frames(); ++t) {
      const double time = tracks.times[t];
      if (!(time > rest + slack) || time < -slack || time > last + slack) continue;
      if (!tracks.is_visible(t, i)) continue;
      if (capture.held_out(t, i)) {
        capture.predicted[t * points + i] = 1;
        continue;
      }
      capture.used[t * points + i] = 1;
      capture.end = std::max(capture.end, time);
      ++capture.used_count;
    }
  }
  if (capture.used_count == 0) capture.begin = 0.0;
}

}  // namespace matterfit::fit
