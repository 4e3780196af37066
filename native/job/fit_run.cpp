// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_run.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>

#include "base/clock.hpp"
#include "base/error.hpp"
#include "base/file.hpp"
#include "fit/data/metrics.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/fit_path.hpp"
#include "job/fit_correction.hpp"
#include "job/fit_experiment.hpp"
#include "job/fit_files.hpp"
#include "job/fit_laws.hpp"
#include "job/fit_like.hpp"
#include "job/fit_race.hpp"
#include "job/fit_report.hpp"
#include "job/fit_search.hpp"
#include "job/fit_state.hpp"
#include "job/fit_values.hpp"
#include "job/fit_weights.hpp"
#include "job/run/folder_lock.hpp"
#include "job/run/run_scene.hpp"
#include "job/run/stage.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

/// Share of the whole that the fit takes; the rest is the fitted scene's simulation.
constexpr double kFitShare = 0.9;

/// One fit of a job, from the folder as it is to the result.
class FitJob {
 public:
  FitJob(const Job& job, const RunOptions& options, Interrupter& interrupter)
      : job_(job),
        doc_(fit_of(job)),
        options_(options),
        target_(resolve_target(options.target)),
        interrupter_(interrupter),
        folder_(job.output.folder) {}

  Json run() {
    say("Reading", 0.0);
    loaded_ = load_experiment(job_, statements_);
    if (doc_.correction > 0) require_hold_out(loaded_.experiment);
    inputs_ = fit_inputs(job_, target_);
    hash_ = hash_inputs(inputs_);
    lock_.emplace(folder_);
    find_start();
    Json document;
    Json fit;
    if (fitted_) {
      document = fitted_->document;
      // It may have been moved since.
      document["output"]["folder"] = folder_.generic_string();
      fit = fitted_->fit;
    } else {
      build_laws();
      try {
        search();
        fit = finish(document);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCancelled) throw;
        return cancelled();
      }
    }
    return simulate(document, fit);
  }

 private:
  void say(const std::string& label, double fraction) {
    enter_stage(interrupter_, label, fraction);
  }

  /// What the folder holds of this fit, or that it holds something else.
  void find_start() {
    const bool afresh = options_.restart == Restart::kAlways;
    auto fitted = afresh ? std::nullopt : read_fitted(folder_);
    auto state = afresh ? std::nullopt : read_fit_state(folder_, "");
    if (state && state->input_hash == hash_) {
      state_ = std::move(*state);
      law_statements_ = state_.statements;
      resumed_ = true;
      return;
    }
    if (fitted && fitted->input_hash == hash_) {
      fitted_ = std::move(fitted);
      return;
    }
    state_.input_hash = hash_;
    state_.inputs = inputs_;
    if (options_.restart != Restart::kNever) return;
    std::string what;
    if (state) {
      what = "an unfinished fit of other inputs. What changed:" + lines(state->inputs);
    } else if (fitted) {
      what = "a fit of other inputs. What changed:" + lines(fitted->inputs);
    } else if (const auto manifest = read_manifest(folder_);
               manifest && manifest->frames_done > 0) {
      what = "the results of the task " + manifest->task + ", which the fit would replace.";
    } else {
      return;
    }
    throw_input(folder_.string() + " holds " + what +
                "\nRun with --restart to replace them, or choose another output folder (--set "
                "output.folder=…).");
  }

  [[nodiscard]] std::string lines(const Inputs& before) const {
    std::string text;
    for (const std::string& line : changes(before, inputs_)) text += "\n  " + line;
    return text;
  }

  /// The fit of a law, made where it is not yet; the body's own where none is sought.
  LawFit& law_fit(material::Law law) { return law_fit(law, interrupter_); }

  LawFit& law_fit(material::Law law, const Interrupter& interrupter) {
    std::unique_ptr<LawFit>& made = fits_[law];
    if (made) return *made;
    made = std::make_unique<LawFit>(setup_of(law), interrupter, law_statements_);
    made->report = [this](const FitReport& report) { show(report); };
    return *made;
  }

  [[nodiscard]] FitSetup setup_of(material::Law law) const {
    FitSetup setup;
    setup.fit = &doc_;
    setup.experiment = &loaded_.experiment;
    setup.law = law;
    setup.target = target_;
    setup.threads = options_.threads;
    setup.parameters = doc_.laws.empty() ? doc_.parameters : parameters_of_law(doc_, own_law_, law);
    for (const RunSource& source : loaded_.sources) {
      Job of_law = source.job;
      for (BodyDoc& body : of_law.scene.bodies) {
        if (!doc_.laws.empty() && body.name == doc_.body) {
          body.material = with_law(body.material, law);
        }
      }
      setup.builders.push_back(scene_builder(std::move(of_law)));
    }
    setup.memory_limit_gb = loaded_.sources.front().job.scene.solver.memory_limit_gb;
    return setup;
  }

  void build_laws() {
    const std::string& body = doc_.laws.empty() ? job_.scene.bodies.front().name : doc_.body;
    own_law_ = body_named(job_.scene, body).material.law;
    laws_ = doc_.laws.empty() ? std::vector<material::Law>{own_law_} : doc_.laws;
    fractions_.assign(laws_.size(), 0.0);
    say("Filling bodies", 0.0);
    const LawFit& own = law_fit(own_law_);
    Arena arena(options_.threads);
    settle_captures(loaded_.experiment, own.scenes(), arena, statements_);
    if (!resumed_) {
      for (const material::Law law : laws_) {
        LawState state;
        state.law = material::traits(law).name;
        state_.laws.push_back(std::move(state));
      }
    }
    started_ = Clock::now();
  }

  void show(const FitReport& report) {
    Progress progress;
    const bool several = laws_.size() > 1 && state_.law < laws_.size();
    {
      const std::lock_guard lock(fractions_mutex_);  // simulations tell from any thread
      if (state_.law < laws_.size()) fractions_[state_.law] = report.fraction;
      double done = 0.0;
      for (std::size_t k = 0; k < laws_.size(); ++k) {
        done += state_.laws[k].finished ? 1.0 : fractions_[k];
      }
      progress.fraction = kFitShare * done / double(laws_.size());
    }
    progress.label =
        fit_label(report, several ? std::string(material::traits(laws_[state_.law]).name) : "");
    interrupter_.report(progress);
  }

  void save() {
    const double since = seconds_since(started_);
    started_ = Clock::now();
    state_.seconds += since;
    state_.statements = law_statements_;
    write_history(folder_, state_.history);
    write_file(folder_ / kFitCheckpointPath, format_fit_state(state_));
  }

  void search() {
    if (!state_.measured_before) {
      LawFit& own = law_fit(own_law_);
      if (const auto errors = own.errors(own.start(), false, state_.before_failed)) {
        state_.before = errors->json();
      }
      state_.measured_before = true;
      save();
    }
    if (std::find(laws_.begin(), laws_.end(), own_law_) == laws_.end()) fits_.erase(own_law_);
    for (;;) {
      const auto next = next_law(state_.laws);
      if (!next) {
        LawState& best = state_.laws[winner()];
        if (!best.left) break;
        best.left = best.finished = false;
        best.spared = true;
        continue;
      }
      state_.law = *next;
      LawState& law = state_.laws[*next];
      try {
        advance(law);
      } catch (const Error& error) {
        if (error.kind() == ErrorKind::kCancelled || error.kind() == ErrorKind::kOutput ||
            doc_.laws.empty()) {
          throw;
        }
        law.failed = error.what();
        law.finished = true;
        law.search.reset();
        fits_.erase(laws_[*next]);
        save();
      }
    }
  }

  /// One step of a law, and the end of those that have no hope after it.
  void advance(LawState& law) {
    LawFit& fit = law_fit(laws_[state_.law]);
    if (law.values.empty()) law = fit.start();
    fit.advance(law, state_.history);
    if (law.finished) finish_law(state_.law);
    for (const LeftLaw& left : hopeless_laws(state_.laws)) {
      LawState& one = state_.laws[left.law];
      one.finished = one.left = true;
      one.reason = left.reason;
      finish_law(left.law);
    }
    save();
  }

  /// What is to be told of a candidate; its scenes go, as there may be many.
  void finish_law(std::size_t k) {
    if (doc_.laws.empty()) return;
    state_.law = k;
    LawState& law = state_.laws[k];
    try {
      measure(law, law_fit(laws_[k]));
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kCompute && error.kind() != ErrorKind::kInput) throw;
      law.failed = error.what();
    }
    if (laws_.size() > 1) fits_.erase(laws_[k]);
  }

  /// A candidate's entry of `models`.
  static void measure(LawState& law, LawFit& fit) {
    std::string failure;
    const auto errors = fit.errors(law, true, failure);
    if (!errors) {
      law.failed = "The fitted scene could not be simulated: " + failure;
      return;
    }
    Json parameters = Json::object();
    for (std::size_t k = 0; k < law.values.size(); ++k) {
      parameters[fit.parameters().parameters()[k].name] = law.values[k];
    }
    const auto held = errors->mean(true);
    const auto seen = errors->mean(false);
    law.model = {{"held_out_mm", held ? Json(*held) : Json()},
                 {"fitted_mm", seen ? Json(*seen) : Json()},
                 {"frames", errors->frames(held.has_value())},
                 {"parameters", parameters}};
  }

  /// The law that is taken: the best of all, or the one that came nearest so far.
  [[nodiscard]] std::size_t winner() const {
    if (laws_.size() > 1 && !next_law(state_.laws)) {
      const Json models = ranked_models(state_.laws);
      if (models[0].at("probability").is_number()) {
        for (std::size_t k = 0; k < state_.laws.size(); ++k) {
          if (models[0].at("law") == state_.laws[k].law) return k;
        }
      }
    }
    return leading_law(state_.laws).value_or(std::min(state_.law, laws_.size() - 1));
  }

  /// The document with the fitted values, as a job that `simulate` takes.
  [[nodiscard]] Json fitted_document(const LawState& law, LawFit& of) {
    Json document = document_to_simulate(job_, folder_);
    if (!doc_.laws.empty()) {
      const material::Material& own = body_named(job_.scene, doc_.body).material;
      (*find_named(document.at("scene"), "bodies", doc_.body))["material"] =
          material_json(with_law(own, material::law_from_name(law.law)));
    }
    add_lists(of.parameters(), document);
    write_values(of.parameters(), law.values, loaded_.sources, job_, document);
    return document;
  }

  /// The search goes on with numbers beside the parameters, where the document asks for it.
  [[nodiscard]] std::optional<FurtherFit> further(const LawState& law) {
    if (doc_.weights == 0 && doc_.correction == 0) return std::nullopt;
    const material::Law of = material::law_from_name(law.law);
    const auto from = [&](const std::string& body, int iterations) {
      return FurtherStart{setup_of(of), law, body, iterations,
                          [this](const FitReport& report) { show(report); }};
    };
    if (doc_.correction > 0) {
      return fit_correction(from(bodies().front(), doc_.correction), interrupter_, law_statements_,
                            state_.history);
    }
    for (const std::string& name : bodies()) {
      const bool sought = !doc_.laws.empty() && name == doc_.body;
      const material::Law own = body_named(job_.scene, name).material.law;
      if ((sought ? of : own) != material::Law::kNeuralIsotropic) continue;
      return fit_weights(from(name, doc_.weights), interrupter_, law_statements_, state_.history);
    }
    statements_.push_back(
        "fit.weights: no fitted body is of the law neural_isotropic, so no weights were moved.");
    return std::nullopt;
  }

  [[nodiscard]] Json fit_json(const LawState& law, const LawFit& of,
                              const std::optional<fit::Uncertainty>& uncertainty) {
    std::vector<std::string> statements = statements_;
    statements.insert(statements.end(), law.statements.begin(), law.statements.end());
    for (const std::string& statement : law_statements_) {
      if (std::find(statements.begin(), statements.end(), statement) == statements.end()) {
        statements.push_back(statement);
      }
    }
    if (!state_.before_failed.empty()) {
      statements.push_back("At the start values the simulation could not be completed: " +
                           state_.before_failed);
    }
    if (uncertainty) {
      for (const fit::Estimate& estimate : uncertainty->estimates) {
        if (!estimate.statement.empty()) statements.push_back(estimate.statement);
      }
      statements.insert(statements.end(), uncertainty->statements.begin(),
                        uncertainty->statements.end());
    }
    int iterations = 0;
    int evaluations = 0;
    for (const LawState& one : state_.laws) {
      iterations += one.iterations;
      evaluations += one.evaluations;
    }
    Json json = {
        {"law", law.law},
        {"converged", law.converged},
        {"reason", law.reason},
        {"loss", loss_name(doc_.loss)},
        {"iterations", iterations},
        {"evaluations", evaluations},
        {"seconds", state_.seconds},
        {"parameters", parameters_json(of.parameters().parameters(), law.values, uncertainty)},
        {"correlation", uncertainty ? correlation_json(*uncertainty) : Json()},
        {"noise_scale", uncertainty ? Json(uncertainty->noise_scale) : Json()},
        {"statements", statements},
        {"before", state_.before},
        {"after", {{"fitted", nullptr}, {"held_out", nullptr}}},
        {"history", state_.history}};
    if (json["before"].is_null()) json["before"] = {{"fitted", nullptr}, {"held_out", nullptr}};
    if (!doc_.laws.empty()) json["models"] = ranked_models(state_.laws);
    return json;
  }

  /// The end of the search: errors of the values, and all of it on disk in place of the checkpoint.
  Json finish(Json& document) {
    const std::size_t best = winner();
    const LawState& found = state_.laws[best];
    if (!found.failed.empty()) {
      throw_compute("fit.laws: none of the laws could be fitted. " + found.law + ": " +
                    found.failed);
    }
    const std::optional<FurtherFit> more = further(found);
    const bool moved = more && more->taken;
    const LawState& law = moved ? more->state : found;
    LawFit& of = moved ? *more->fit : law_fit(laws_[best]);
    std::optional<fit::Uncertainty> uncertainty;
    if (law.search) {
      say("Fitting: errors of the values", kFitShare);
      try {
        uncertainty = of.uncertainty(law);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCompute) throw;
        statements_.push_back(std::string("Errors of the values could not be found: ") +
                              error.what());
      }
    }
    document = fitted_document(law, of);
    if (moved && doc_.weights > 0) {
      const std::string name = more->report.at("body").get<std::string>();
      const material::Material material = body_named(job_from(document).scene, name).material;
      write_weights(material, name, folder_, document);
    }
    Json after;
    if (doc_.loss != FitDoc::Loss::kTracks) {
      // The run that follows compares point by point, which means nothing for clouds.
      std::string failure;
      if (const auto errors = of.errors(law, true, failure)) after = errors->json();
    }
    save();
    Json fit = fit_json(law, of, uncertainty);
    if (more) fit[more->key] = more->report;
    fit["warning"] = fit_warning(fit, of.is_far(law));
    if (after.is_object()) fit["after"] = after;
    add_likes(job_from(document), bodies(), loaded_.experiment.runs, of.scenes(), options_.threads,
              fit);
    write_fitted(folder_, {hash_, inputs_, document, fit});
    // Only now: until then the search would go on from it.
    std::error_code code;
    fs::remove(folder_ / kFitCheckpointPath, code);
    return fit;
  }

  [[nodiscard]] Job job_from(const Json& document) const {
    ReadOptions options;
    options.base_folder = job_.base_folder;
    return read_job(document.dump(), options);
  }

  /// Whose material is written.
  [[nodiscard]] std::vector<std::string> bodies() const {
    return fitted_bodies(doc_, job_.captures.front().body);
  }

  /// The fitted scene's run, with the fit in its result.
  Json simulate(const Json& document, Json fit) {
    const Job scene = job_from(document);
    Job fitted = scene;
    fitted.task = Task::kCompare;
    std::vector<std::string> kept = {kFittedPath, kFitHistoryPath};
    if (fit.contains("weights") && fit.at("weights").at("taken") == true) {
      kept.push_back(weights_file_name(fit.at("weights").at("body").get<std::string>()));
    }
    ErrorPool after;
    RunExtras extras;
    extras.task = task_name(Task::kFit);
    extras.begin = kFitShare;
    extras.kept = kept;
    extras.clouds = doc_.loss != FitDoc::Loss::kTracks;
    extras.compared = [&](const fit::CaptureInput& compared, const std::vector<double>& error_mm,
                          double size) {
      for (const fit::Run& run : loaded_.experiment.runs) {
        for (const fit::Capture& capture : run.captures) {
          if (capture.input.name == compared.name) after.add(capture, error_mm, size);
        }
      }
    };
    extras.finish = [&](Json& result) {
      if (doc_.loss == FitDoc::Loss::kTracks) fit["after"] = after.json();
      const std::string held_out = held_out_warning(fit.at("after"));
      if (!held_out.empty()) {
        const auto warning = fit.at("warning").get<std::string>();
        fit["warning"] = warning.empty() ? held_out : warning + " " + held_out;
      }
      result["fit"] = fit;
      std::vector<std::string> files = write_materials(folder_, scene, bodies(), fit);
      files.insert(files.end(), kept.begin(), kept.end());
      return files;
    };
    RunOptions options = options_;
    if (options.restart == Restart::kNever) options.restart = Restart::kWhereChanged;
    lock_.reset();  // the run takes it again
    try {
      return run_scenes(fitted, options, interrupter_, extras);
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kCompute) {
        (void)write_unfinished(scene, std::move(fit), "failed", error);
        throw_compute("The fit is done, and its values are in " + folder_.generic_string() +
                      "/result.json, but the fitted scene could not be simulated: " + error.what());
      }
      if (error.kind() != ErrorKind::kCancelled) throw;
      return write_unfinished(scene, std::move(fit), "cancelled", error);
    }
  }

  /// The best so far of a search that was broken off; the checkpoint stays.
  Json cancelled() {
    const std::size_t best = winner();
    LawState& law = state_.laws[best];
    LawFit& of = law_fit(laws_[best], undisturbed_);
    if (law.values.empty()) law = of.start();
    if (!law.finished) law.reason = "Cancelled; these are the best values so far.";
    ErrorPool after;
    try {
      double size = 0.0;
      const std::vector<fit::Run>& runs = loaded_.experiment.runs;
      for (std::size_t r = 0; r < runs.size(); ++r) {
        for (const fit::Capture& capture : runs[r].captures) {
          const mpm::Scene& scene = of.scenes()[r];
          const mpm::Body& body = scene.bodies[fit::body_index(scene, capture.input.body)];
          if (capture.used_count > 0) size = std::max(size, fit::body_size(body.rest));
        }
      }
      if (law.ended.empty() || of.mean_missed(law) <= law.ended_mean) {
        after.add(of.distances(law), size, 0, false);
      } else {
        law.values = law.ended;  // of the first start, while the search goes on from the second
      }
    } catch (const Error& error) {
      // The stage's scenes are not built, as after a fit that was taken up and broken off at once.
      if (error.kind() != ErrorKind::kCancelled) throw;
    }
    const Json document = fitted_document(law, of);
    Json fit = fit_json(law, of, std::nullopt);
    fit["after"] = after.json();
    fit["warning"] = "The fit was cancelled: these are the best values so far. Resume goes on.";
    return write_unfinished(job_from(document), std::move(fit), "cancelled",
                            Error(ErrorKind::kCancelled, "Cancelled."));
  }

  /// A result without the fitted scene's run.
  Json write_unfinished(const Job& scene, Json fit, const char* status, const Error& why) const {
    (void)write_materials(folder_, scene, bodies(), fit);
    Json result = {{"status", status},
                   {"task", "fit"},
                   {"error", why.what()},
                   {"exit_status", exit_status(why.kind())},
                   {"version", MATTERFIT_VERSION},
                   {"target", target_name(target_)},
                   {"folder", folder_.string()},
                   {"fit", std::move(fit)}};
    write_file(folder_ / "result.json",
               result.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
    return result;
  }

  const Job& job_;
  const FitDoc& doc_;
  RunOptions options_;
  mpm::SimdTarget target_;
  Interrupter& interrupter_;
  const Interrupter undisturbed_;  ///< for what is still to be told after Cancel
  fs::path folder_;
  std::vector<std::string> statements_;
  std::vector<std::string> law_statements_;
  LoadedExperiment loaded_;
  Inputs inputs_;
  std::string hash_;
  std::optional<FolderLock> lock_;
  std::optional<Fitted> fitted_;
  bool resumed_ = false;
  FitState state_;
  material::Law own_law_ = material::Law::kFixedCorotated;
  std::vector<material::Law> laws_;
  /// Of laws that are being fitted, and of the document's while the start is looked at.
  std::map<material::Law, std::unique_ptr<LawFit>> fits_;
  std::vector<double> fractions_;  ///< of each law's fit, for progress
  std::mutex fractions_mutex_;
  Clock::time_point started_;
};

}  // namespace

Json run_fit(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  return FitJob(job, options, interrupter).run();
}

}  // namespace matterfit::job
