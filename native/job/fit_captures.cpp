// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_captures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "capture/binding.hpp"
#include "capture/check.hpp"
#include "fit/data/follow.hpp"
#include "fit/data/metrics.hpp"
#include "job/documents/fit_document.hpp"

namespace matterfit::job {
namespace {

constexpr double kSlack = 1e-9;  // of a frame
/// Of the points of a capture, that may lie off the body.
constexpr double kStray = 0.05;
constexpr double kStrayDistance = 2.0;  // particle separations
constexpr double kOtherBody = 0.25;     // of the body's size
constexpr double kDefaultNoise = 1e-3;  // of the body's size
constexpr std::size_t kFewestFrames = 2;
/// Points of one frame's cloud: more tell little more.
constexpr std::size_t kMostCompared = 8192;
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

/// The samples that a fit may look at, as tracks of their own.
capture::Tracks visible_to_fit(const FitCapture& capture) {
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

/// The first frame in which any of the points is seen.
std::size_t first_frame(const capture::Tracks& tracks) {
  std::size_t first = tracks.frames();
  for (std::size_t i = 0; i < tracks.points; ++i) {
    first = std::min(first, first_seen(tracks, i));
  }
  return first;
}

/// Until when the body is where it starts [s]: its release, or the capture's first frame and those
/// after it over which nothing has moved by more than the noise.
double still_until(const FitCapture& capture) {
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

/// "3 of its 64 points (a, b, c)".
std::string named(const CaptureInput& input, const std::vector<std::size_t>& points) {
  std::string text = fmt::format("{} of its {} points (", points.size(), input.tracks.points);
  for (std::size_t k = 0; k < std::min(points.size(), kMostNamed); ++k) {
    text += (k == 0 ? "" : ", ") + input.label(points[k]);
  }
  return text + (points.size() > kMostNamed ? ", …)" : ")");
}

/// Takes their rest from points that were first seen when the body was elsewhere already.
void leave_out_late(FitCapture& capture, double slack, std::vector<std::string>& statements) {
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
      "captures." + input.name + ": " + named(input, late) +
      " are seen first when the body moves, so where they belong on it is not known; they are left "
      "out. To use them give 'positions'.");
}

/// Where the points are at rest comes from frames that the fit must then be allowed to see: points
/// of which it sees none of them are held out; a capture that has no others is refused.
void hold_out_unknown(FitCapture& capture, double slack, std::vector<std::string>& statements) {
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
  statements.push_back("captures." + input.name + ": " + named(input, unknown) +
                       " are seen at rest in held-out frames only; they are held out.");
}

void mark_used(FitCapture& capture, const SceneDoc& scene) {
  const CaptureInput& input = capture.input;
  const capture::Tracks& tracks = input.tracks;
  const double slack = kSlack / scene.fps;
  const double last = (scene.frames() - 1) / scene.fps;
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

/// Which times a capture and its scene cover.
std::string extent(const FitCapture& capture, const SceneDoc& scene) {
  const std::vector<double>& times = capture.input.tracks.times;
  return fmt::format("its {} frame{} from {:.4g} to {:.4g} s of the scene, which ends at {:.4g} s",
                     times.size(), times.size() == 1 ? " goes" : "s go", times.front(),
                     times.back(), (scene.frames() - 1) / scene.fps);
}

void state_what_is_odd(const FitCapture& capture, const CaptureDoc& doc,
                       std::vector<std::string>& statements) {
  const CaptureInput& input = capture.input;
  if (doc.holdout.frames) {
    const auto has = [](const std::vector<std::uint8_t>& marks) {
      return std::find(marks.begin(), marks.end(), 1) != marks.end();
    };
    const std::string frames =
        fmt::format("[{}, {})", (*doc.holdout.frames)[0], (*doc.holdout.frames)[1]);
    if (!has(input.held_out_frames)) {
      statements.push_back(capture.path + ".holdout.frames: no sample lies in the frames " +
                           frames + ", so none is held out.");
    } else if (!has(capture.predicted)) {
      statements.push_back(capture.path + ".holdout.frames: none of the samples in the frames " +
                           frames +
                           " can be predicted (not seen, before the motion or outside the scene's "
                           "frames), so there is no held-out error.");
    }
  }
  if (!capture.clouds && capture.used_count > 0) {
    const std::string exchanged = capture::summarise(visible_to_fit(capture)).exchanged_warning;
    if (!exchanged.empty()) statements.push_back("captures." + input.name + ": " + exchanged);
  }
  if (capture.used_count == 0 && !doc.holdout.capture) {
    statements.push_back(capture.path +
                         ": none of its samples is left to fit (held out, not seen, before the "
                         "release or outside the scene's frames); it is compared only.");
  }
}

/// A point tells where a body is, but not what shape it has.
void refuse_single_points(const FitCapture& capture) {
  for (const std::size_t t : capture.used_frames()) {
    if (capture.compared(t).size() > 1) return;
  }
  if (capture.used_count == 0) return;
  throw_input(capture.path +
              ": its frames have one point each, which is no cloud. Give a file with the body's "
              "points, or the loss 'tracks', which follows single points.");
}

}  // namespace

double FitCapture::deviation(std::size_t point) const {
  const std::size_t samples = clouds ? 0 : input.rest_samples[point];
  return sigma[point] * std::sqrt(samples > 0 ? 1.0 + 1.0 / double(samples) : 1.0);
}

std::vector<std::size_t> FitCapture::used_frames() const {
  const auto points = static_cast<std::ptrdiff_t>(input.tracks.points);
  std::vector<std::size_t> frames;
  auto begin = used.begin();
  for (std::size_t t = 0; t < input.tracks.frames(); ++t, begin += points) {
    const bool any =
        std::any_of(begin, begin + points, [](std::uint8_t mark) { return mark != 0; });
    if (any) frames.push_back(t);
  }
  return frames;
}

std::vector<std::size_t> FitCapture::compared(std::size_t frame) const {
  const std::size_t points = input.tracks.points;
  std::vector<std::size_t> seen;
  for (std::size_t i = 0; i < points; ++i) {
    if (used[frame * points + i] != 0) seen.push_back(i);
  }
  if (!clouds || seen.size() <= kMostCompared) return seen;
  std::vector<std::size_t> drawn;
  for (const std::size_t k : fit::draw(seen.size(), kMostCompared, frame)) drawn.push_back(seen[k]);
  return drawn;
}

fit::CloudScale FitCapture::cloud_scale() const {
  const std::size_t frame = used_frames().front();
  Points points;
  double noise = 0.0;
  for (const std::size_t i : compared(frame)) {
    points.push_back(input.tracks.positions[frame * input.tracks.points + i]);
    noise = std::max(noise, sigma[i]);
  }
  Arena arena(1);
  return fit::cloud_scale(points, noise, arena);
}

std::vector<FitRun> load_fit_runs(const Job& job, std::vector<std::string>& statements) {
  if (job.captures.empty()) throw_input("captures: a fit needs at least one capture to fit to.");
  std::vector<FitRun> runs;
  bool any = false;
  std::string extents;
  for (const SceneGroup& group : scene_groups(job)) {
    FitRun run;
    run.group = group;
    run.job = group_job(job, group);
    if (group.own) run.overrides = job.captures[group.captures.front()].scene_overrides;
    for (std::size_t k = 0; k < run.job.captures.size(); ++k) {
      const CaptureDoc& doc = run.job.captures[k];
      if (doc.noise && *doc.noise == 0.0) {
        throw_input(doc.path +
                    ".noise is 0: every sample would count infinitely much, and no error could "
                    "be stated. Give the standard deviation of the recording in metres, or leave "
                    "it out and it is estimated.");
      }
      FitCapture capture;
      capture.path = doc.path;
      capture.clouds = job.fit && job.fit->loss != FitDoc::Loss::kTracks;
      if (capture.clouds && !doc.holdout.tracks.empty()) {
        throw_input(doc.path +
                    ".holdout.tracks: the points of clouds are others in every frame, "
                    "so none can be held out. Hold out frames, or the capture.");
      }
      capture.input = load_capture(run.job, k, capture.clouds);
      capture.places_given = !doc.positions.empty();
      const double slack = kSlack / run.job.scene.fps;
      leave_out_late(capture, slack, statements);
      if (!doc.holdout.capture) hold_out_unknown(capture, slack, statements);
      mark_used(capture, run.job.scene);
      if (capture.clouds) refuse_single_points(capture);
      state_what_is_odd(capture, doc, statements);
      const std::size_t frames = capture.used_frames().size();
      if (frames > 0 && frames < kFewestFrames) {
        throw_input(doc.path + ": only " + std::to_string(frames) +
                    " frame of it is left to fit to, and at least two are needed (" +
                    extent(capture, run.job.scene) +
                    "). Hold out less, let the scene's frames cover more of the capture, or look "
                    "at the file's times, which are in seconds.");
      }
      run.fitted = run.fitted || capture.used_count > 0;
      extents += (extents.empty() ? "" : "; ") + capture.input.name + ": " +
                 extent(capture, run.job.scene);
      run.captures.push_back(std::move(capture));
    }
    any = any || run.fitted;
    runs.push_back(std::move(run));
  }
  if (!any) {
    throw_input(
        "captures: every sample is held out, not seen, or outside the scene's frames; nothing is "
        "left to fit to (" +
        extents +
        "). Shorten a 'holdout', or look at start_frame, scene.frames and the file's times, which "
        "are in seconds.");
  }
  return runs;
}

void settle_noise(FitRun& run, const mpm::Scene& scene, std::vector<std::string>& statements) {
  for (FitCapture& capture : run.captures) {
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
    const mpm::Body& body = scene.bodies[fit::body_index(scene, input.body)];
    const double fallback = kDefaultNoise * fit::body_size(body.rest);
    // Its differences over time tell nothing of clouds, whose points change from frame to frame.
    const bool told = capture.used_count > 0 && !capture.clouds;
    const double estimate = told ? capture::summarise(visible_to_fit(capture)).noise : 0.0;
    const double noise = estimate > 0.0 ? estimate : fallback;
    for (const std::size_t i : missing) capture.sigma[i] = noise;
    if (capture.used_count == 0) continue;
    const std::string given = missing.size() == input.tracks.points
                                  ? "no noise is given"
                                  : "the noise of " + named(input, missing) + " is given as 0";
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

void describe_clouds(const FitRun& run, std::vector<std::string>& statements) {
  for (const FitCapture& capture : run.captures) {
    if (!capture.clouds || capture.used_count == 0) continue;
    const fit::CloudScale scale = capture.cloud_scale();
    statements.push_back(fmt::format(
        "captures.{}: clouds are compared by means over a radius of {:.3g} mm. By these two "
        "samplings of the same body miss each other by {:.3g} mm: an error is to be seen against "
        "that.",
        capture.input.name, 1e3 * scale.reach, 1e3 * fit::mean_length(scale.sigma)));
  }
}

void check_places(const FitRun& run, const mpm::Scene& scene, Arena& arena,
                  std::vector<std::string>& statements) {
  const double separation = 0.5 * scene.dx;
  for (const FitCapture& capture : run.captures) {
    // A cloud that begins in the middle of the motion says nothing of the body at rest.
    const capture::Tracks& tracks = capture.input.tracks;
    const std::size_t first = first_frame(tracks);
    if (capture.clouds && first < tracks.frames() && tracks.times[first] > kSlack / scene.fps) {
      continue;
    }
    Points places;
    for (std::size_t i = 0; i < capture.input.rest.size(); ++i) {
      if (capture.input.held_out_points[i] == 0 && capture.input.rest[i].allFinite()) {
        places.push_back(capture.input.rest[i]);
      }
    }
    if (places.empty()) continue;
    const mpm::Body& body = scene.bodies[fit::body_index(scene, capture.input.body)];
    const capture::MeshBinding binding(places, body.rest, separation, {}, arena);
    const std::size_t stray = binding.count_beyond(kStrayDistance * separation);
    if (double(stray) <= kStray * double(places.size())) continue;
    const double size = fit::body_size(body.rest) + separation;
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

}  // namespace matterfit::job
