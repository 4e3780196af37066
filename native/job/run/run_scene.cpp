// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/run_scene.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "base/clock.hpp"
#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/check.hpp"
#include "fit/data/metrics.hpp"
#include "job/documents/images_document.hpp"
#include "job/run/bake_outputs.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/cache.hpp"
#include "job/run/capture_input.hpp"
#include "job/run/checkpoint.hpp"
#include "job/run/compare.hpp"
#include "job/run/compare_images.hpp"
#include "job/run/observe.hpp"
#include "job/run/penetration.hpp"
#include "job/run/state_file.hpp"
#include "job/run/stats_log.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

Json to_json(const fit::Ringdown& ring) {
  return {{"drop_m", ring.drop_m},
          {"frequency_hz", ring.frequency_hz},
          {"damping_ratio", ring.damping_ratio},
          {"amplitude_m", ring.amplitude_m},
          {"drift_m", ring.drift_m},
          {"residual_m", ring.residual_m},
          {"direction", {ring.direction.x(), ring.direction.y(), ring.direction.z()}}};
}

/// The error of the simulated ringdown, in per cent of what was recorded.
Json ringdown_error(const fit::Ringdown& ring, const fit::Ringdown& measured) {
  return {{"drop_percent", 100.0 * (ring.drop_m / measured.drop_m - 1.0)},
          {"frequency_percent", 100.0 * (ring.frequency_hz / measured.frequency_hz - 1.0)},
          {"damping_ratio", ring.damping_ratio - measured.damping_ratio}};
}

/// One run of a job, from the folder as it is to the result.
class Run {
 public:
  Run(const Job& job, const RunOptions& options, Interrupter& interrupter, const RunExtras& extras)
      : job_(job),
        options_(options),
        extras_(extras),
        target_(resolve_target(options.target)),
        interrupter_(interrupter),
        arena_(std::make_shared<Arena>(options.threads)) {}

  Json run() {
    report(0.0, "Reading");
    for (std::size_t i = 0; i < job_.captures.size(); ++i) {
      captures_.push_back(load_capture(job_, i, extras_.clouds));
      note_summary(captures_.back());
    }
    const Inputs inputs = simulation_inputs(job_, target_);
    cache_.emplace(job_, inputs, options_.restart);
    report(0.0, "Filling bodies");
    built_ = build_scene(job_, *arena_, interrupter_);
    notes_.insert(notes_.end(), built_.notes.begin(), built_.notes.end());
    count_ = static_cast<std::size_t>(job_.scene.frames());
    observations_.emplace(job_, built_.scene, captures_, *arena_);
    if (job_.task == Task::kCompare && extras_.images && !images_of(job_).empty()) {
      report(0.0, "Reading images");
      images_.emplace(job_, scene(), notes_, interrupter_);
    }
    excited_.emplace(job_.scene, bool(extras_.strained));
    if (job_.bakes()) {
      report(0.0, "Binding meshes");
      bake_.emplace(job_, scene(), *arena_, interrupter_);
    }
    find_start();
    // Nothing of an earlier run is removed before the job has proved sound.
    cache_->begin(job_, inputs, extras_.kept);
    stats_.emplace(cache_->folder());
    if (sound_ < count_) stats_->keep_before(number(sound_));
    if (bake_) prepare_bake();
    begin_manifest();
    for (std::size_t k = 0; k < count_; ++k) frame(k);
    finish_files();
    return result();
  }

 private:
  [[nodiscard]] int number(std::size_t k) const { return job_.scene.first_frame + int(k); }
  [[nodiscard]] const mpm::Scene& scene() const { return built_.scene; }
  [[nodiscard]] std::string_view task() const {
    return extras_.task.empty() ? task_name(job_.task) : extras_.task;
  }

  void report(double fraction, const std::string& label) {
    Progress progress;
    progress.fraction = extras_.begin + (1.0 - extras_.begin) * fraction;
    progress.label = label;
    progress.frame = number(done_);
    progress.last_frame = job_.scene.end_frame - 1;
    interrupter_.report(progress);
    interrupter_.check();
  }

  void note_summary(const fit::CaptureInput& input) {
    const capture::CaptureSummary summary = capture::summarise(input.tracks);
    const std::string where = "captures." + input.name + ": ";
    if (!summary.unit_warning.empty()) notes_.push_back(where + summary.unit_warning);
    // A fit has said it before it began.
    if (!summary.exchanged_warning.empty() && extras_.task.empty()) {
      notes_.push_back(where + summary.exchanged_warning);
    }
    if (summary.missing == 0.0) return;
    char text[120];
    std::snprintf(text, sizeof text,
                  "%.2g %% of the samples are missing (not visible, or not finite)",
                  100.0 * summary.missing);
    notes_.push_back(where + text);
  }

  /// What of the caches is there already, of the same `output`.
  void prepare_bake() {
    Manifest& manifest = cache_->manifest();
    const std::string hash = hash_inputs(output_inputs(job_));
    if (manifest.output_hash != hash) {
      remove_caches();
      manifest.output_hash = hash;
      manifest.frames_baked = 0;
    }
    baked_ = static_cast<std::size_t>(manifest.frames_baked);
    for (std::size_t k = 0; k < baked_; ++k) {
      const auto files = bake_->frame_files(number(k));
      if (!std::all_of(files.begin(), files.end(),
                       [&](const std::string& path) { return cache_->is_sound(path); })) {
        baked_ = k;
      }
    }
    const auto sequences = bake_->sequence_files();
    const bool complete = std::all_of(sequences.begin(), sequences.end(),
                                      [&](const auto& path) { return cache_->is_sound(path); });
    bake_->start(complete ? BakeOutputs::kAllFrames : baked_);
    for (const std::string& note : bake_->notes()) notes_.push_back(note);
  }

  void remove_caches() {
    static const std::set<std::string> kFolders = {"volume", "mesh", "points", "splat",
                                                   "attributes"};
    const auto files = cache_->manifest().files;
    for (const auto& [path, file] : files) {
      if (kFolders.count(fs::path(path).begin()->string()) > 0) cache_->remove(path);
    }
  }

  /// From the last checkpoint where states are missing, else nothing is simulated.
  void find_start() {
    sound_ = cache_->sound_states();
    if (sound_ == count_) return;
    check_memory();
    const mpm::Simulation::Options options{
        .target = target_,
        .memory_limit = static_cast<std::size_t>(1e9 * job_.scene.solver.memory_limit_gb),
        .hand_over = true,
        .interrupter = &interrupter_};
    report(0.0, "Preparing");
    simulation_ = std::make_unique<mpm::Simulation>(scene(), arena_, options);
    std::size_t start = 0;
    if (sound_ > 0) {
      const auto checkpoint = read_checkpoint(cache_->folder(), cache_->manifest().input_hash);
      const int last = number(sound_) - 1;
      if (checkpoint && checkpoint->frame >= job_.scene.first_frame && checkpoint->frame <= last) {
        simulation_->load(checkpoint->bytes);
        start = static_cast<std::size_t>(checkpoint->frame - job_.scene.first_frame) + 1;
        notes_.push_back("resumed after frame " + std::to_string(checkpoint->frame));
      } else {
        notes_.emplace_back("no usable checkpoint: simulated from the first frame");
      }
    }
    sound_ = start;
  }

  void check_memory() const {
    const auto estimate = mpm::Simulation::estimate(scene());
    const double needed = 1e-9 * double(estimate.bytes);
    const double limit = job_.scene.solver.memory_limit_gb;
    if (needed <= limit) return;
    char text[160];
    std::snprintf(text, sizeof text, "%zu particles need about %.3g GB, the limit is %.3g GB",
                  estimate.particles, needed, limit);
    throw_input(std::string("scene.solver.memory_limit_gb: ") + text +
                ". Use a larger scene.particle_separation, or raise the limit.");
  }

  void begin_manifest() {
    Manifest& manifest = cache_->manifest();
    manifest.task = task();
    if (bake_) manifest.grids = bake_->grids();
    reused_ = sound_;
    if (sound_ < count_) manifest.complete = false;
    if (job_.task == Task::kCompare) recordings_ = cache_->begin_comparison(job_);
    cache_->record_volatile("stats.jsonl");
    last_checkpoint_ = Clock::now();
  }

  void frame(std::size_t k) {
    interrupter_.check();
    const bool have_state = k < sound_;
    const bool bake_files = bake_ && k >= baked_;
    const bool bake_sequences = bake_ && bake_->needs(k);
    done_ = k;
    const bool watched = observations_->any() || excited_->any();
    if (have_state && !watched && !bake_files && !bake_sequences) return;
    report(double(k) / double(count_), !have_state  ? (bake_ ? "Baking" : "Simulating")
                                       : bake_files ? "Baking"
                                                    : "Reading states");
    const std::string path = state_path(number(k));
    mpm::FrameState state;
    if (have_state) {
      state = read_state(cache_->folder() / path, scene());
    } else {
      if (k > 0) {
        const mpm::FrameReport report = simulation_->advance(interrupter_);
        stats_->add(report);
        state = simulation_->state();
        note_penetration(report, state);
      } else {
        state = simulation_->state();
      }
      write_file(cache_->folder() / path, format_state(scene(), state));
      cache_->record(path);
    }
    if (observations_->any()) observations_->record(state);
    if (excited_->any()) excited_->record(state);
    if (bake_files || bake_sequences) {
      bake_->bake(state, k, bake_files);
      if (bake_files) {
        for (const std::string& file : bake_->frame_files(number(k))) cache_->record(file);
      }
    }
    Manifest& manifest = cache_->manifest();
    manifest.frames_done = std::max(manifest.frames_done, int(k) + 1);
    if (bake_) manifest.frames_baked = std::max(manifest.frames_baked, int(k) + 1);
    if (!have_state || bake_files) cache_->save();
    if (!have_state) checkpoint(k);
  }

  /// After the manifest, so that a checkpoint is never ahead of it.
  void checkpoint(std::size_t k) {
    ++since_checkpoint_;
    const bool last = k + 1 == count_;
    if (last || (since_checkpoint_ < job_.output.checkpoint_frames &&
                 seconds_since(last_checkpoint_) < job_.output.checkpoint_seconds)) {
      return;
    }
    if (bake_) bake_->flush();
    const Checkpoint checkpoint{cache_->manifest().input_hash, number(k), simulation_->save()};
    write_file(cache_->folder() / kCheckpointPath, format_checkpoint(checkpoint));
    cache_->record_volatile(kCheckpointPath);
    since_checkpoint_ = 0;
    last_checkpoint_ = Clock::now();
  }

  void finish_files() {
    done_ = count_ - 1;
    report(1.0, "Writing results");
    if (bake_) {
      bake_->finish();
      for (const std::string& path : bake_->sequence_files()) cache_->record(path);
    }
    for (const std::string& path : observations_->write(cache_->folder())) cache_->record(path);
    compare();
    simulation_.reset();
    cache_->remove(kCheckpointPath);
    cache_->manifest().complete = true;
    cache_->save();
  }

  void compare() {
    if (job_.task != Task::kCompare) return;
    Json list = Json::array();
    for (std::size_t i = 0; i < captures_.size(); ++i) {
      report(1.0, "Comparing");
      const mpm::Body& body = *std::find_if(
          scene().bodies.begin(), scene().bodies.end(),
          [&](const mpm::Body& candidate) { return candidate.name == captures_[i].body; });
      const double size = fit::body_size(body.rest) + 0.5 * scene().dx;
      const CaptureError error =
          compare_capture(captures_[i], observations_->at_capture(i), size, job_.scene.fps,
                          job_.scene.first_frame, *arena_, interrupter_);
      if (extras_.compared) extras_.compared(captures_[i], error.error_mm, size);
      // A measure of results, no result: comparing does not change the hash of what is compared.
      cache_->record(write_compare(cache_->folder(), captures_[i], error, captures_.size() == 1),
                     false);
      list.push_back(error.summary);
    }
    compare_ = {{"captures", list}};
    if (images_) {
      report(1.0, "Comparing images");
      compare_["images"] = images_->run(cache_->folder(), arena_, target_);
      for (const std::string& file : images_->files()) cache_->record(file, false);
    }
    cache_->manifest().compared_hash = recordings_;
    for (const char* key : {"mean_mm", "p95_mm", "max_mm", "rms_mm", "mean_percent"}) {
      if (list.size() == 1 && list[0].contains(key)) compare_[key] = list[0][key];
    }
  }

  Json result() {
    Json json = {{"status", "done"},
                 {"task", task()},
                 {"version", MATTERFIT_VERSION},
                 {"input_hash", cache_->manifest().input_hash},
                 {"result_hash", result_hash(cache_->manifest())},
                 {"target", target_name(target_)},
                 {"threads", arena_->threads()},
                 {"fps", cache_->manifest().fps_given},
                 {"frames", {job_.scene.first_frame, job_.scene.end_frame}},
                 {"frames_reused", reused_},
                 {"folder", cache_->folder().string()},
                 {"dx", scene().dx},
                 {"seconds", seconds_since(start_)}};
    add_bodies(json);
    add_stats(json);
    add_observations(json);
    if (!compare_.is_null()) json["compare"] = compare_;
    if (!notes_.empty()) json["notes"] = notes_;
    if (extras_.finish) {
      for (const std::string& path : extras_.finish(json)) cache_->record_volatile(path);
    }
    if (!json.contains("fit") && !cache_->fit().is_null()) json["fit"] = cache_->fit();
    const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
    write_file(cache_->folder() / "result.json", text);
    cache_->record_volatile("result.json");
    if (job_.task == Task::kCompare && !job_.output.report.empty()) {
      write_file(cache_->folder() / job_.output.report, text);
      cache_->record_volatile(job_.output.report);
    }
    cache_->save();
    return json;
  }

  void add_bodies(Json& json) const {
    std::size_t particles = 0;
    Json list = Json::array();
    for (std::size_t b = 0; b < scene().bodies.size(); ++b) {
      const mpm::Body& body = scene().bodies[b];
      particles += body.rest.size();
      double volume = 0.0;
      for (const double v : body.volumes) volume += v;
      list.push_back({{"name", body.name},
                      {"particles", body.rest.size()},
                      {"volume_m3", volume},
                      {"mass_kg", volume * body.density},
                      {"fill", built_.fill_reports[b]}});
    }
    json["particles"] = particles;
    json["bodies"] = list;
  }

  void add_stats(Json& json) {
    double dt = 0.0;
    long long substeps = 0;
    double penetration = 0.0;
    double simulated = 0.0;
    std::string limit;
    for (const Json& line : stats_->lines()) {
      const double step = line.value("dt", 0.0);
      if (step > 0.0 && (dt == 0.0 || step < dt)) {
        dt = step;
        limit = line.value("dt_limit", "");
      }
      substeps += line.value("substeps", 0);
      penetration = std::max(penetration, line.value("max_penetration", 0.0));
      simulated += line.value("seconds", 0.0);
      if (line.contains("note")) notes_.push_back(line.value("note", ""));
    }
    json["dt"] = dt;
    json["dt_limit"] = limit;
    json["substeps"] = substeps;
    json["max_penetration_m"] = penetration;
    json["simulation_seconds"] = simulated;
    if (deepest_.depth > 0.0) notes_.push_back(penetration_note(deepest_));
    for (std::string& note : excited_->notes()) notes_.push_back(std::move(note));
    if (extras_.strained) extras_.strained(job_, *excited_);
  }

  /// Remembers who sank deepest into what, where that is more than a particle separation.
  void note_penetration(const mpm::FrameReport& report, const mpm::FrameState& state) {
    if (report.max_penetration <= std::max(0.5 * scene().dx, deepest_.depth)) return;
    Penetration found = deepest(scene(), state);
    if (found.depth <= 0.0) return;  // it was out again by the end of the frame
    found.depth = report.max_penetration;
    deepest_ = std::move(found);
  }

  /// Markers may stand off the body, but not by its own size: they move along with it all the same,
  /// so that the comparison would look right.
  void note_distance(std::size_t capture) {
    const fit::CaptureInput& input = captures_[capture];
    const auto body = std::find_if(scene().bodies.begin(), scene().bodies.end(),
                                   [&](const mpm::Body& b) { return b.name == input.body; });
    const double distance = observations_->farthest(capture);
    if (body == scene().bodies.end() || distance <= 0.5 * fit::body_size(body->rest)) return;
    char text[80];
    std::snprintf(text, sizeof text, ": points lie up to %.3g m off '", distance);
    notes_.push_back("captures." + input.name + text + input.body +
                     "' at rest; are unit, transform and start_frame right?");
  }

  void add_observations(Json& json) {
    std::optional<fit::Ringdown> first;
    const auto take = [&](const std::optional<fit::Ringdown>& ring, Json& into, const char* key) {
      if (ring) into[key] = to_json(*ring);
    };
    Json probes = Json::array();
    for (std::size_t i = 0; i < job_.probes.size(); ++i) {
      Json probe = {{"name", job_.probes[i].name}, {"body", job_.probes[i].body}};
      const auto ring = observations_->probe_ringdown(i);
      take(ring, probe, "ringdown");
      if (!first) first = ring;
      probes.push_back(probe);
    }
    Json captures = Json::array();
    for (std::size_t i = 0; i < captures_.size(); ++i) {
      const fit::CaptureInput& input = captures_[i];
      Json capture = {{"name", input.name},
                      {"body", input.body},
                      {"points", input.tracks.points},
                      {"samples", input.tracks.frames()}};
      if (input.aligned) {
        capture["alignment"] = {{"rms_mm", input.alignment_rms_mm},
                                {"residual_mm", input.alignment_residual_mm}};
      }
      const auto ring = observations_->capture_ringdown(i);
      const auto measured = measured_ringdown(input);
      take(ring, capture, "ringdown");
      take(measured, capture, "measured_ringdown");
      if (ring && measured) capture["ringdown_error"] = ringdown_error(*ring, *measured);
      if (!first) first = ring;
      note_distance(i);
      const fit::SimulatedCapture simulated = observations_->at_capture(i);
      if (simulated.outside > 0) {
        notes_.push_back("captures." + input.name + ": " + std::to_string(simulated.outside) +
                         " of " + std::to_string(simulated.times.size()) +
                         " samples lie outside the simulated time; they are NaN in simulated.npz");
      }
      if (simulated.interpolated) {
        notes_.push_back("captures." + input.name +
                         ": samples lie between frames and are interpolated; simulate at the "
                         "capture's rate to avoid it");
      }
      captures.push_back(capture);
    }
    if (!first) first = observations_->body_ringdown();
    if (first) json["ringdown"] = to_json(*first);
    if (!probes.empty()) json["probes"] = probes;
    if (!captures.empty()) json["captures"] = captures;
  }

  const Job& job_;
  RunOptions options_;
  const RunExtras& extras_;
  mpm::SimdTarget target_;
  Interrupter& interrupter_;
  std::shared_ptr<Arena> arena_;
  std::string recordings_;  ///< hash of what is compared with, as it was before the run
  Clock::time_point start_ = Clock::now();
  std::vector<fit::CaptureInput> captures_;
  std::optional<Cache> cache_;
  std::optional<StatsLog> stats_;
  BuiltScene built_;
  std::optional<Observations> observations_;
  std::optional<ImageComparison> images_;
  std::optional<ExcitedRange> excited_;
  std::optional<BakeOutputs> bake_;
  std::unique_ptr<mpm::Simulation> simulation_;
  std::size_t count_ = 0;
  std::size_t sound_ = 0;  ///< frames whose states are taken from disk
  std::size_t baked_ = 0;  ///< frames whose caches are taken from disk
  std::size_t reused_ = 0;
  std::size_t done_ = 0;
  int since_checkpoint_ = 0;
  Clock::time_point last_checkpoint_;
  Json compare_;
  std::vector<std::string> notes_;
  Penetration deepest_;
};

}  // namespace

Json run_scene(const Job& job, const RunOptions& options, Interrupter& interrupter,
               const RunExtras& extras) {
  return Run(job, options, interrupter, extras).run();
}

}  // namespace matterfit::job
