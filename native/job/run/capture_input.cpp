// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/capture_input.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "capture/align.hpp"
#include "capture/swaps.hpp"
#include "job/documents/document_error.hpp"
#include "job/documents/images_document.hpp"

namespace matterfit::job {
namespace {

constexpr double kFrameSlack = 1e-9;  // of a frame, against rounding of frame / fps

/// Indices [begin, end) of the samples in scene frames [first, last).
std::array<std::size_t, 2> samples_between(const std::vector<double>& times, double first,
                                           double last) {
  const auto begin = std::lower_bound(times.begin(), times.end(), first);
  const auto end = std::lower_bound(times.begin(), times.end(), last);
  return {static_cast<std::size_t>(begin - times.begin()),
          static_cast<std::size_t>(end - times.begin())};
}

/// The mean over the quiet frames in which the point is seen, else where it is seen first. What is
/// held out does not count among the quiet frames where others are left.
void take_rest(fit::CaptureInput& input, double slack) {
  const capture::Tracks& tracks = input.tracks;
  input.rest.assign(tracks.points, Vec3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (std::size_t i = 0; i < tracks.points; ++i) {
    Vec3d sum[2] = {Vec3d::Zero(), Vec3d::Zero()};  // seen by a fit, held out
    std::size_t count[2] = {0, 0};
    for (std::size_t t = 0; t < tracks.frames(); ++t) {
      if (!tracks.is_visible(t, i)) continue;
      const bool quiet = input.release && tracks.times[t] <= *input.release + slack;
      if (!quiet && count[0] + count[1] > 0) break;
      const std::size_t which = input.held_out_frames[t] != 0 ? 1 : 0;
      sum[which] += tracks.position(t, i);
      ++count[which];
      if (!quiet) break;
    }
    const std::size_t which = count[0] > 0 ? 0 : 1;
    input.rest_samples[i] = count[which];
    if (count[which] > 0) input.rest[i] = sum[which] / double(count[which]);
  }
}

std::vector<std::uint8_t> held_out_points(const CaptureDoc& doc, const fit::CaptureInput& input,
                                          const std::string& path) {
  std::vector<std::uint8_t> held(input.tracks.points, doc.holdout.capture ? 1 : 0);
  for (const std::string& wanted : doc.holdout.tracks) {
    bool found = false;
    for (std::size_t i = 0; i < held.size(); ++i) {
      if (input.label(i) == wanted || std::to_string(i) == wanted) {
        held[i] = 1;
        found = true;
      }
    }
    if (!found) {
      throw DocumentError(ErrorKind::kInput, path,
                          ".holdout.tracks: the capture has no point '" + wanted + "'.");
    }
  }
  return held;
}

std::vector<capture::Swap> swaps_of(const CaptureDoc& doc, const capture::Tracks& tracks) {
  std::vector<capture::Swap> swaps;
  for (const SwapDoc& given : doc.swaps) {
    std::array<std::size_t, 2> tracked{};
    for (std::size_t k = 0; k < 2; ++k) {
      const auto found = capture::find_marker(tracks, given.tracks[k]);
      if (!found) throw_input("swaps: the capture has no point '" + given.tracks[k] + "'.");
      tracked[k] = *found;
    }
    swaps.push_back({given.sample, tracked[0], tracked[1]});
  }
  return swaps;
}

/// The markers of `align`; that one of them is missing is said of it, not of `markers`.
capture::Tracks read_quiet(const std::filesystem::path& file,
                           const capture::TracksOptions& options) {
  try {
    return capture::read_tracks(file, options);
  } catch (const Error& error) {
    throw Error(error.kind(), std::string("align: ") + error.what());
  }
}

}  // namespace

void check_captures(const Job& job) {
  const bool images = !images_of(job).empty();
  if (job.task == Task::kCompare && job.captures.empty() && !images) {
    throw_input("captures: compare needs at least one capture to compare with.");
  }
  if (job.task == Task::kDiagnose && images) {
    throw_input("captures: a diagnosis looks at tracks, and these are images.");
  }
  const bool by_tracks = job.task == Task::kDiagnose || job.task == Task::kCheck;
  // Without a section `fit` that is what is missing.
  if (job.fit && (by_tracks || (job.task == Task::kFit && !images))) require_tracks(job);
}

void require_tracks(const Job& job) {
  if (!job.captures.empty()) return;
  throw_input(images_of(job).empty()
                  ? "captures: a fit needs at least one capture to fit to."
                  : "captures: all are by images, and tracks are needed here. Add a capture of "
                    "points that are followed, or fit to the images without this.");
}

std::optional<double> body_release(const BodyDoc& body, const SceneDoc& scene) {
  std::optional<double> last;
  for (const PinDoc& pin : body.pins) {
    if (!pin.release || *pin.release >= scene.end_frame) continue;
    last = std::max(last.value_or(-1e300), scene.seconds(*pin.release));
  }
  return last;
}

fit::CaptureInput load_capture(const Job& job, std::size_t index, bool clouds) {
  const CaptureDoc& doc = job.captures[index];
  const SceneDoc& scene = job.scene;
  const std::string& path = doc.path;
  return at_place(path, [&] {
    fit::CaptureInput input;
    input.name = doc.name;
    input.body = doc.body;
    input.start = scene.seconds(doc.start_frame.value_or(scene.first_frame));
    const double slack = kFrameSlack / scene.fps;

    capture::TracksOptions options;
    options.unit = doc.unit;
    options.up = doc.up;
    options.fps = doc.fps > 0.0 ? doc.fps : scene.fps;
    options.transform =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(doc.transform.data());
    if (doc.align) {
      capture::TracksOptions quiet = options;
      quiet.markers = doc.align->markers;
      const capture::Tracks markers = read_quiet(doc.file, quiet);
      std::vector<double> times = markers.times;
      for (double& time : times) time += input.start;
      const auto range = samples_between(times, scene.seconds(doc.align->begin) - slack,
                                         scene.seconds(doc.align->end) - slack);
      capture::AlignOptions align;
      align.begin = range[0];
      align.end = range[1];
      if (range[1] <= range[0]) {
        const std::string last = doc.align->end > doc.align->begin + 1
                                     ? "s " + std::to_string(doc.align->begin) + " to " +
                                           std::to_string(doc.align->end - 1)
                                     : " " + std::to_string(doc.align->begin);
        throw_input("align.frames: the capture has no sample in the scene's frame" + last + ".");
      }
      const capture::RigidFit fit = capture::align_tracks(markers, doc.align->positions, align);
      input.aligned = true;
      input.alignment_residual_mm = fit.residual_mm;
      input.alignment_rms_mm = fit.rms_mm;
      // Unit and up are applied before `transform`, which is where the fit was made.
      options.transform = fit.matrix() * options.transform;
    }
    options.markers = doc.markers;
    if (doc.noise) options.noise = {*doc.noise};
    options.clouds = clouds;
    input.tracks = capture::read_tracks(doc.file, options);
    for (double& time : input.tracks.times) time += input.start;
    capture::apply_swaps(swaps_of(doc, input.tracks), input.tracks);

    if (doc.release) {
      input.release = scene.seconds(*doc.release);
    } else {
      input.release = body_release(body_named(scene, doc.body), scene);
    }
    input.held_out_points = held_out_points(doc, input, path);
    input.held_out_frames.assign(input.tracks.frames(), 0);
    if (doc.holdout.frames) {
      const auto range =
          samples_between(input.tracks.times, scene.seconds((*doc.holdout.frames)[0]) - slack,
                          scene.seconds((*doc.holdout.frames)[1]) - slack);
      std::fill(input.held_out_frames.begin() + static_cast<std::ptrdiff_t>(range[0]),
                input.held_out_frames.begin() + static_cast<std::ptrdiff_t>(range[1]),
                std::uint8_t{1});
    }
    if (doc.front && (clouds || input.tracks.points != 1)) {
      throw_input("front: the capture has " + std::to_string(input.tracks.points) +
                  " points; how far a body reaches is one track (name it in 'markers'), fitted "
                  "with the loss \"tracks\".");
    }
    input.front = doc.front;
    input.rest_samples.assign(input.tracks.points, 0);
    if (doc.positions.empty()) {
      take_rest(input, slack);
    } else if (doc.positions.size() != input.tracks.points) {
      throw_input("positions: " + std::to_string(doc.positions.size()) + " places for " +
                  std::to_string(input.tracks.points) + " points of the capture.");
    } else {
      input.rest = doc.positions;
    }
    return input;
  });
}

}  // namespace matterfit::job
