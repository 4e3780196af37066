// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_run.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "fit/data/metrics.hpp"
#include "job/documents/excitation_document.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/fit_path.hpp"
#include "job/fit_candidates.hpp"
#include "job/fit_correction.hpp"
#include "job/fit_experiment.hpp"
#include "job/fit_files.hpp"
#include "job/fit_laws.hpp"
#include "job/fit_like.hpp"
#include "job/fit_predicted.hpp"
#include "job/fit_published.hpp"
#include "job/fit_report.hpp"
#include "job/fit_state.hpp"
#include "job/fit_values.hpp"
#include "job/fit_weights.hpp"
#include "job/run/folder_lock.hpp"
#include "job/run/run_scene.hpp"
#include "job/run/stage.hpp"
#include "material/neural/published_material.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

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
      laws_.emplace(job_, target_, options_.threads, interrupter_, loaded_, std::move(state_),
                    statements_);
      try {
        laws_->search();
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
      return;
    }
    if (fitted && fitted->input_hash == hash_) {
      fitted_ = std::move(fitted);
      return;
    }
    state_.input_hash = hash_;
    state_.inputs = inputs_;
    if (options_.restart != Restart::kNever) return;
    refuse_what_is_there(folder_, inputs_);
  }

  /// The document with the fitted values, as a job that `simulate` takes.
  [[nodiscard]] Json fitted_document(const fit::LawState& law, fit::LawFit& of) {
    Json document = document_to_simulate(job_, folder_);
    if (!doc_.laws.empty()) {
      const material::Material& own = body_named(job_.scene, doc_.body).material;
      (*find_named(document.at("scene"), "bodies", doc_.body))["material"] =
          material_json(with_law(own, material::law_from_name(law.law)));
    }
    // What it was fitted to before.
    for (const std::string& name : bodies()) {
      find_named(document.at("scene"), "bodies", name)->erase("excited");
    }
    add_lists(of.parameters(), document);
    write_values(of.parameters(), law.values, loaded_.sources, job_, document);
    return document;
  }

  /// The search goes on with numbers beside the parameters, where the document asks for it.
  [[nodiscard]] std::optional<FurtherFit> further(const fit::LawState& law) {
    if (doc_.weights == 0 && doc_.correction == 0) return std::nullopt;
    const material::Law of = material::law_from_name(law.law);
    const auto from = [&](const std::string& body, int iterations) {
      return FurtherStart{laws_->setup_of(of), law, body, iterations,
                          [this](const fit::SearchProgress& report) { laws_->show(report); }};
    };
    if (doc_.correction > 0) {
      return fit_correction(from(bodies().front(), doc_.correction), bodies(), interrupter_,
                            laws_->law_statements(), laws_->state().history);
    }
    for (const std::string& name : bodies()) {
      const bool sought = !doc_.laws.empty() && name == doc_.body;
      const material::Law own = body_named(job_.scene, name).material.law;
      const material::Law law_of_body = sought ? of : own;
      if (law_of_body == material::Law::kPublished) {
        return fit_published_weights(from(name, doc_.weights), interrupter_,
                                     laws_->law_statements(), laws_->state().history);
      }
      if (law_of_body != material::Law::kNeuralIsotropic) continue;
      return fit_weights(from(name, doc_.weights), interrupter_, laws_->law_statements(),
                         laws_->state().history);
    }
    statements_.emplace_back(kNoWeights);
    return std::nullopt;
  }

  [[nodiscard]] Json fit_json(const fit::LawState& law, const fit::LawFit& of,
                              const std::optional<fit::Uncertainty>& uncertainty) {
    std::vector<std::string> statements = statements_;
    statements.insert(statements.end(), law.statements.begin(), law.statements.end());
    for (const std::string& statement : laws_->law_statements()) {
      if (std::find(statements.begin(), statements.end(), statement) == statements.end()) {
        statements.push_back(statement);
      }
    }
    if (!laws_->state().before_failed.empty()) {
      statements.push_back("At the start values the simulation could not be completed: " +
                           laws_->state().before_failed);
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
    for (const fit::LawState& one : laws_->state().laws) {
      iterations += one.iterations;
      evaluations += one.evaluations;
    }
    Json json = {
        {"law", law.law},
        {"converged", law.converged()},
        {"reason", law.reason()},
        {"loss", loss_name(doc_.loss)},
        {"iterations", iterations},
        {"evaluations", evaluations},
        {"seconds", laws_->state().seconds},
        {"parameters", parameters_json(of.parameters().parameters(), law.values, uncertainty)},
        {"correlation", uncertainty ? correlation_json(*uncertainty) : Json()},
        {"noise_scale", uncertainty ? Json(uncertainty->noise_scale) : Json()},
        {"statements", statements},
        {"before", laws_->state().before},
        {"after", {{"fitted", nullptr}, {"held_out", nullptr}}},
        {"history", laws_->state().history}};
    if (json["before"].is_null()) json["before"] = {{"fitted", nullptr}, {"held_out", nullptr}};
    if (!doc_.laws.empty())
      json["models"] = ranked_models(laws_->state().laws, laws_->state().models);
    return json;
  }

  /// The end of the search: errors of the values, and all of it on disk in place of the checkpoint.
  Json finish(Json& document) {
    const std::size_t best = laws_->winner();
    const fit::LawState& found = laws_->state().laws[best];
    if (!found.failed.empty()) {
      throw_compute("fit.laws: none of the laws could be fitted. " + found.law + ": " +
                    found.failed);
    }
    const std::optional<FurtherFit> more = further(found);
    const bool moved = more && more->taken;
    const fit::LawState& law = moved ? more->state : found;
    fit::LawFit& of = moved ? *more->fit : laws_->fit(best);
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
    Json predicted;
    if (uncertainty && doc_.draws > 0) {
      say("Fitting: how sure the prediction is", kFitShare);
      try {
        predicted = predicted_json(of, law, *uncertainty, doc_.draws);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCompute) throw;
        statements_.push_back(std::string("How sure the prediction is could not be found: ") +
                              error.what());
      }
    }
    document = fitted_document(law, of);
    if (moved && doc_.weights > 0) {
      const std::string name = more->report.at("body").get<std::string>();
      const mpm::Scene& scene = of.scenes().front();
      const material::Material& moved_law = scene.bodies[fit::body_index(scene, name)].material;
      if (moved_law.published) {
        write_published_weights(moved_law.published->weights, name, folder_, document);
      } else {
        const material::Material material = body_named(job_from(document).scene, name).material;
        write_weights(material, name, folder_, document);
      }
    }
    Json after;
    if (doc_.loss != FitDoc::Loss::kTracks) {
      // The run that follows compares point by point, which means nothing for clouds.
      std::string failure;
      if (const auto errors = errors_of(of, law, true, failure)) after = errors->json();
    }
    laws_->save();
    Json fit = fit_json(law, of, uncertainty);
    if (more) fit[more->key] = more->report;
    if (predicted.is_object()) fit["predicted"] = predicted;
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

  /// Takes in what the fitted bodies of a run go through as long as something of it was fitted.
  void note_seen(const Job& run, const ExcitedRange& range,
                 std::map<std::string, material::Excitation>& seen) const {
    for (const fit::Run& one : loaded_.experiment.runs) {
      for (const fit::Capture& capture : one.captures) {
        const bool here = std::any_of(
            run.captures.begin(), run.captures.end(),
            [&](const CaptureDoc& listed) { return listed.name == capture.input.name; });
        if (!here || capture.used_count == 0) continue;
        constexpr double kRounding = 1e-6;
        const double last = run.scene.first_frame + capture.end * run.scene.fps + kRounding;
        const auto found = range.seen(capture.input.body, last);
        if (!found) continue;
        const auto [place, fresh] = seen.emplace(capture.input.body, *found);
        if (!fresh) widen(place->second, *found);
      }
    }
  }

  /// The fitted scene with what its bodies were seen at.
  [[nodiscard]] Job with_seen(Job scene,
                              const std::map<std::string, material::Excitation>& seen) const {
    for (BodyDoc& body : scene.scene.bodies) {
      const auto found = seen.find(body.name);
      const std::vector<std::string> fitted = bodies();
      const bool is_fitted = std::find(fitted.begin(), fitted.end(), body.name) != fitted.end();
      if (found == seen.end() || !is_fitted) continue;
      body.excited = found->second;
      (*find_named(scene.document.at("scene"), "bodies", body.name))["excited"] =
          excitation_json(found->second);
    }
    return scene;
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
    std::map<std::string, material::Excitation> seen;
    extras.strained = [&](const Job& run, const ExcitedRange& range) {
      note_seen(run, range, seen);
    };
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
      std::vector<std::string> files =
          write_materials(folder_, with_seen(scene, seen), bodies(), fit);
      files.insert(files.end(), kept.begin(), kept.end());
      return files;
    };
    RunOptions options = options_;
    if (options.restart == Restart::kNever) options.restart = Restart::kWhereChanged;
    lock_.reset();  // the run takes it again
    return run_or_unfinished({folder_, scene, bodies(), target_}, fit,
                             [&] { return run_scenes(fitted, options, interrupter_, extras); });
  }

  /// The best so far of a search that was broken off; the checkpoint stays.
  Json cancelled() {
    const std::size_t best = laws_->winner();
    fit::LawState& law = laws_->state().laws[best];
    fit::LawFit& of = laws_->fit(best, undisturbed_);
    if (law.values.empty()) law = of.start();
    if (!law.finished()) {
      law.phase = fit::Finished{false, "Cancelled; these are the best values so far."};
    }
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
      const auto* first = std::get_if<fit::FirstEnd>(&law.second);
      if (first == nullptr || of.mean_missed(law) <= first->mean) {
        after.add(of.distances(law), size, 0, false);
      } else {
        law.values = first->values;  // of the first start, while the search goes on from the second
      }
    } catch (const Error& error) {
      // The stage's scenes are not built, as after a fit that was taken up and broken off at once.
      if (error.kind() != ErrorKind::kCancelled) throw;
    }
    const Json document = fitted_document(law, of);
    Json fit = fit_json(law, of, std::nullopt);
    fit["after"] = after.json();
    fit["warning"] = kCancelledWarning;
    return write_unfinished({folder_, job_from(document), bodies(), target_}, std::move(fit),
                            Error(ErrorKind::kCancelled, "Cancelled."));
  }

  const Job& job_;
  const FitDoc& doc_;
  RunOptions options_;
  mpm::SimdTarget target_;
  Interrupter& interrupter_;
  const Interrupter undisturbed_;  ///< for what is still to be told after Cancel
  fs::path folder_;
  std::vector<std::string> statements_;
  LoadedExperiment loaded_;
  Inputs inputs_;
  std::string hash_;
  std::optional<FolderLock> lock_;
  std::optional<Fitted> fitted_;
  FitState state_;                     ///< that the search begins with
  std::optional<FitCandidates> laws_;  ///< not of a fit that is done
};

}  // namespace

Json run_fit(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  return FitJob(job, options, interrupter).run();
}

}  // namespace matterfit::job
