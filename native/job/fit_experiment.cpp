// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_experiment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "base/error.hpp"
#include "capture/check.hpp"
#include "fit/data/capture_marks.hpp"
#include "fit/data/capture_noise.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/fit_path.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/capture_input.hpp"
#include "job/run/scene_at_level.hpp"

namespace matterfit::job {
namespace {

constexpr std::size_t kFewestFitFrames = 2;

/// Which times a capture and its scene cover.
std::string extent(const fit::Capture& capture, const fit::Clock& clock) {
  const std::vector<double>& times = capture.input.tracks.times;
  return fmt::format("its {} frame{} from {:.4g} to {:.4g} s of the scene, which ends at {:.4g} s",
                     times.size(), times.size() == 1 ? " goes" : "s go", times.front(),
                     times.back(), clock.end());
}

void state_what_is_odd(const fit::Capture& capture, const CaptureDoc& doc,
                       std::vector<std::string>& statements) {
  const fit::CaptureInput& input = capture.input;
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
    const std::string exchanged =
        capture::summarise(fit::visible_to_fit(capture)).exchanged_warning;
    if (!exchanged.empty()) statements.push_back("captures." + input.name + ": " + exchanged);
  }
  if (capture.used_count == 0 && !doc.holdout.capture) {
    statements.push_back(capture.path +
                         ": none of its samples is left to fit (held out, not seen, before the "
                         "release or outside the scene's frames); it is compared only.");
  }
}

/// A point tells where a body is, but not what shape it has.
void refuse_single_points(const fit::Capture& capture) {
  for (const std::size_t t : capture.used_frames()) {
    if (capture.compared(t, capture.used).size() > 1) return;
  }
  if (capture.used_count == 0) return;
  throw_input(capture.path +
              ": its frames have one point each, which is no cloud. Give a file with the body's "
              "points, or the loss 'tracks', which follows single points.");
}

}  // namespace

LoadedExperiment unread_experiment(const Job& job) {
  LoadedExperiment loaded;
  for (const SceneGroup& group : scene_groups(job)) {
    RunSource source{group, nullptr, group_job(job, group)};
    if (group.own) source.overrides = job.captures[group.captures.front()].scene_overrides;
    const SceneDoc& scene = source.job.scene;
    fit::Run run;
    run.build = scene_builder(source.job);
    run.clock = {scene.fps, scene.first_frame, scene.end_frame};
    for (const BodyDoc& body : scene.bodies) run.origins[body.name] = body.placement.position;
    run.own = group.own;
    if (source.overrides.is_object()) {
      run.sets = [overrides = source.overrides](const fit::Address& address) {
        return find_quantity(overrides, address) != nullptr;
      };
    }
    for (const CaptureDoc& doc : source.job.captures) {
      fit::Capture capture;
      capture.path = doc.path;
      capture.input.name = doc.name;
      capture.input.body = doc.body;
      capture.viewing.start_frame = doc.start_frame.value_or(scene.first_frame);
      capture.places_given = !doc.positions.empty();
      capture.clouds = job.fit && job.fit->loss != fit::Loss::kTracks;
      run.captures.push_back(std::move(capture));
    }
    loaded.experiment.runs.push_back(std::move(run));
    loaded.sources.push_back(std::move(source));
  }
  return loaded;
}

namespace {

/// Other simulators say «sticky» where a body that is pressed does not slip and may leave.
void state_what_is_glued(const SceneDoc& scene, std::vector<std::string>& statements) {
  for (const ColliderDoc& collider : scene.colliders) {
    if (collider.contact.kind != shape::ContactKind::kGlue ||
        collider.contact.method == shape::ContactMethod::kNode) {
      continue;
    }
    statements.push_back("Collider '" + collider.name +
                         "' holds for good what has touched it (contact kind glue). If what was "
                         "recorded lifts off again, make it no_slip or friction.");
  }
}

}  // namespace

LoadedExperiment load_experiment(const Job& job, std::vector<std::string>& statements,
                                 bool others) {
  require_tracks(job);
  LoadedExperiment loaded = unread_experiment(job);
  state_what_is_glued(loaded.sources.front().job.scene, statements);
  bool any = false;
  std::string extents;
  for (std::size_t r = 0; r < loaded.sources.size(); ++r) {
    const Job& source = loaded.sources[r].job;
    fit::Run& run = loaded.experiment.runs[r];
    const double slack = fit::kFrameSlack / run.clock.fps;
    for (std::size_t k = 0; k < source.captures.size(); ++k) {
      const CaptureDoc& doc = source.captures[k];
      fit::Capture& capture = run.captures[k];
      if (doc.noise && *doc.noise == 0.0) {
        throw_input(doc.path +
                    ".noise is 0: every sample would count infinitely much, and no error could "
                    "be stated. Give the standard deviation of the recording in metres, or leave "
                    "it out and it is estimated.");
      }
      if (capture.clouds && !doc.holdout.tracks.empty()) {
        throw_input(doc.path +
                    ".holdout.tracks: the points of clouds are others in every frame, "
                    "so none can be held out. Hold out frames, or the capture.");
      }
      capture.input = load_capture(source, k, capture.clouds);
      fit::leave_out_late(capture, slack, statements);
      if (!doc.holdout.capture) fit::hold_out_unknown(capture, slack, statements);
      fit::mark_used(capture, run.clock);
      if (capture.clouds) refuse_single_points(capture);
      state_what_is_odd(capture, doc, statements);
      const std::size_t frames = capture.used_frames().size();
      if (frames > 0 && frames < kFewestFitFrames) {
        throw_input(doc.path + ": only " + std::to_string(frames) +
                    " frame of it is left to fit to, and at least two are needed (" +
                    extent(capture, run.clock) +
                    "). Hold out less, let the scene's frames cover more of the capture, or look "
                    "at the file's times, which are in seconds.");
      }
      run.fitted = run.fitted || capture.used_count > 0;
      extents +=
          (extents.empty() ? "" : "; ") + capture.input.name + ": " + extent(capture, run.clock);
    }
    any = any || run.fitted;
  }
  if (!any && !others) {
    throw_input(
        "captures: every sample is held out, not seen, or outside the scene's frames; nothing is "
        "left to fit to (" +
        extents +
        "). Shorten a 'holdout', or look at start_frame, scene.frames and the file's times, which "
        "are in seconds.");
  }
  return loaded;
}

void settle_captures(fit::Experiment& experiment, const std::vector<mpm::Scene>& scenes,
                     Arena& arena, std::vector<std::string>& statements) {
  for (std::size_t r = 0; r < experiment.runs.size(); ++r) {
    std::vector<fit::Capture>& captures = experiment.runs[r].captures;
    fit::settle_noise(captures, scenes[r], statements);
    fit::describe_clouds(captures, statements);
    fit::check_places(captures, scenes[r], arena, statements);
  }
}

LoadedExperiment prepare_experiment(const Job& job, int threads, const Interrupter& interrupter,
                                    std::vector<std::string>& statements) {
  LoadedExperiment loaded = load_experiment(job, statements);
  Arena arena(threads);
  std::vector<mpm::Scene> scenes;
  scenes.reserve(loaded.experiment.runs.size());
  for (const fit::Run& run : loaded.experiment.runs) {
    scenes.push_back(run.build(1.0, arena, interrupter));
  }
  settle_captures(loaded.experiment, scenes, arena, statements);
  return loaded;
}

fit::SceneBuilder scene_builder(Job job) {
  const auto held = std::make_shared<const Job>(std::move(job));
  return [held](double level, Arena& arena, const Interrupter& interrupter) {
    return level == 1.0 ? build_scene(*held, arena, interrupter).scene
                        : scene_at_level(*held, level, arena, interrupter);
  };
}

}  // namespace matterfit::job
