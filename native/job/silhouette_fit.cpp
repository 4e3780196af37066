// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/silhouette_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.hpp"
#include "fit/model/silhouette_problem.hpp"
#include "fit/numerics/uncertainty.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/inputs.hpp"
#include "job/fit_experiment.hpp"
#include "job/fit_files.hpp"
#include "job/fit_report.hpp"
#include "job/fit_values.hpp"
#include "job/image_sightings.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/run_scene.hpp"
#include "job/run/stage.hpp"

namespace matterfit::job {
namespace {

constexpr double kFitShare = 0.9;
constexpr double kNarrow = 1.0;  ///< blurs [reduced pixels]
constexpr double kWide = 4.0;
/// Factors at which a stiffness is tried that nothing is known of.
constexpr double kScan[] = {1.0 / 64, 1.0 / 16, 0.25, 4.0, 16.0, 64.0};

/// One fit of a job's images.
class SilhouetteFit {
 public:
  SilhouetteFit(const Job& job, const RunOptions& options, Interrupter& interrupter)
      : job_(job), doc_(fit_of(job)), options_(options), interrupter_(interrupter) {}

  Json run() {
    const auto begin = std::chrono::steady_clock::now();
    if (!doc_.laws.empty()) {
      throw_input("fit.laws: laws are compared by tracks only; a fit to images takes one.");
    }
    if (doc_.correction > 0) {
      throw_input("fit.correction: it is judged by tracks only; leave it out of a fit to images.");
    }
    say("Reading", 0.0);
    loaded_ = unread_experiment(job_);
    for (fit::Run& run : loaded_.experiment.runs) run.fitted = true;
    build();
    say("Fitting: the start", 0.01);
    fit::SilhouetteModel& model = *model_;
    values_ = parameters_->starts();
    settle_model(model, values_);
    const Json before = agreement();
    scan();
    search(kWide);
    search(kNarrow);
    say("Fitting: errors of the values", 0.95 * kFitShare);
    const fit::Uncertainty known = uncertainty();
    const Json after = agreement();
    Json document = document_to_simulate(job_, job_.output.folder);
    write_values(*parameters_, values_, loaded_.sources, job_, document);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    return simulate(document, fit_json(known, before, after, seconds.count()));
  }

 private:
  void say(const std::string& label, double fraction) {
    enter_stage(interrupter_, label, fraction);
  }

  void build() {
    say("Filling bodies", 0.0);
    Arena arena(options_.threads);
    std::vector<mpm::Scene> scenes;
    scenes.push_back(loaded_.experiment.runs.front().build(1.0, arena, interrupter_));
    sightings_ = load_sightings(job_, scenes.front(), statements_);
    parameters_.emplace(doc_.parameters, loaded_.experiment.runs, scenes);
    fit::SilhouetteModel::Options options;
    options.target = resolve_target(options_.target);
    options.threads = options_.threads;
    options.memory_limit_gb = job_.scene.solver.memory_limit_gb;
    model_ = std::make_unique<fit::SilhouetteModel>(std::move(scenes.front()), *parameters_,
                                                    options, interrupter_);
    for (const ImageSighting& sighting : sightings_) {
      if (!sighting.reduced.held_out) until_ = std::max(until_, sighting.reduced.view.time);
    }
  }

  /// Substeps and sizes of particles.
  void settle_model(fit::SilhouetteModel& model, const std::vector<double>& values) {
    model.settle_steps(values, until_);
    std::vector<fit::Sighting> reduced;
    reduced.reserve(sightings_.size());
    for (const ImageSighting& sighting : sightings_) reduced.push_back(sighting.reduced);
    fit::settle_sizes(model, values, reduced);
    for (std::size_t k = 0; k < sightings_.size(); ++k) {
      sightings_[k].reduced.view.size = reduced[k].view.size;
    }
  }

  [[nodiscard]] std::vector<fit::Parameter> parameters_at(const std::vector<double>& values) const {
    std::vector<fit::Parameter> parameters = parameters_->parameters();
    for (std::size_t k = 0; k < values.size(); ++k) parameters[k].start = values[k];
    return parameters;
  }

  [[nodiscard]] fit::SilhouetteProblem problem(double blur) {
    std::vector<fit::Sighting> used;
    for (const ImageSighting& sighting : sightings_) {
      if (!sighting.reduced.held_out) used.push_back(sighting.reduced);
    }
    fit::SilhouetteProblem result(*model_, parameters_at(values_), std::move(used), blur);
    result.simulated = [this](int count) {
      // How many there will be is not known: half of what is left with every forty.
      const double part = 1.0 - std::exp2(-double(simulated_ + count) / 40.0);
      say("Fitting", 0.9 * kFitShare * part);
    };
    return result;
  }

  /// Starts of stiffness that nothing is known of: the best of some factors off the scene's.
  void scan() {
    fit::SilhouetteProblem at = problem(kWide);
    for (std::size_t k = 0; k < values_.size(); ++k) {
      const fit::Address& path = parameters_->path(k);
      const bool given = std::any_of(doc_.parameters.begin(), doc_.parameters.end(),
                                     [&](const fit::ParameterSpec& spec) {
                                       return !spec.start.empty() && spec.path.same_number(path);
                                     });
      if (!path.quantity->scanned || given) continue;
      const fit::Parameter& parameter = parameters_->parameters()[k];
      std::vector<std::vector<double>> tried{values_};
      for (const double factor : kScan) {
        const double value = values_[k] * factor;
        if (value <= parameter.low || value >= parameter.high) continue;
        tried.push_back(values_);
        tried.back()[k] = value;
      }
      std::vector<Eigen::VectorXd> points;
      points.reserve(tried.size());
      for (const auto& values : tried) points.push_back(natural(values));
      const auto residuals = at.evaluate(points);
      double best = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < tried.size(); ++i) {
        if (!residuals[i] || !(residuals[i]->squaredNorm() < best)) continue;
        best = residuals[i]->squaredNorm();
        values_ = tried[i];
      }
      simulated_ += static_cast<int>(tried.size());
    }
  }

  [[nodiscard]] Eigen::VectorXd natural(const std::vector<double>& values) const {
    Eigen::VectorXd point(Eigen::Index(values.size()));
    for (std::size_t k = 0; k < values.size(); ++k) {
      point[Eigen::Index(k)] = fit::to_natural(parameters_->parameters()[k].coordinate, values[k]);
    }
    return point;
  }

  void search(double blur) {
    model_->settle_steps(values_, until_);
    fit::SilhouetteProblem at = problem(blur);
    fit::LeastSquaresOptions options;
    options.huber = doc_.huber;
    options.iterations = doc_.iterations;
    search_.emplace(parameters_at(values_), options);
    state_ = search_->start();
    while (!state_.finished) {
      try {
        search_->iterate(at, state_);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCompute || at.failure().empty()) throw;
        throw_compute(std::string(error.what()) + " " + at.failure());
      }
      history_.push_back({{"stage", blur == kWide ? "wide" : "narrow"},
                          {"iteration", state_.iteration},
                          {"cost", state_.cost},
                          {"values", at.physical(state_.point)}});
    }
    values_ = at.physical(state_.point);
    simulated_ += state_.evaluations;
    iterations_ += state_.iteration;
  }

  [[nodiscard]] fit::Uncertainty uncertainty() {
    fit::SilhouetteProblem at = problem(kNarrow);
    search_->linearise(at, state_);
    return fit::uncertainty(search_->parameters(), state_, at.effective(state_.residual),
                            doc_.huber, at.blocks());
  }

  /// Of all images at the present values, in their own pixels.
  [[nodiscard]] Json agreement() const {
    std::vector<fit::SilhouetteView> views;
    views.reserve(sightings_.size());
    for (const ImageSighting& sighting : sightings_) {
      views.push_back(sighting.reduced.view);
      views.back().camera = sighting.camera;
    }
    std::vector<fit::Agreement> agreements(sightings_.size());
    const fit::SilhouetteModel::Sink sink = [&](std::size_t v, const std::vector<float>& mask) {
      const ImageSighting& sighting = sightings_[v];
      std::vector<float> ours = mask;
      for (std::size_t i = 0; i < sighting.seen.size(); ++i) {
        if (sighting.seen[i] == 0) ours[i] = 0.0F;
      }
      agreements[v] =
          fit::agreement(ours, sighting.matte, sighting.camera.width, sighting.camera.height);
    };
    const auto failures = model_->draw({values_}, views, {sink});
    if (!failures.front().empty()) return {{"fitted", nullptr}, {"held_out", nullptr}};
    return silhouettes_json(sightings_, agreements);
  }

  /// In words, for who sees no numbers of it elsewhere.
  static std::string outlines_text(const Json& before, const Json& after) {
    std::string text;
    for (const char* key : {"fitted", "held_out"}) {
      if (!before.at(key).is_object() || !after.at(key).is_object()) continue;
      text += fmt::format("{}{}: IoU {:.3f} → {:.3f}", text.empty() ? "Outlines, " : "; ",
                          std::string(key) == "fitted" ? "fitted images" : "held-out images",
                          before.at(key).at("iou").get<double>(),
                          after.at(key).at("iou").get<double>());
      const Json& pixels = after.at(key).at("contour_px");
      if (pixels.is_number()) text += fmt::format(", {:.2f} pixels apart", pixels.get<double>());
    }
    return text + ".";
  }

  [[nodiscard]] Json fit_json(const fit::Uncertainty& known, const Json& before, const Json& after,
                              double seconds) {
    std::vector<std::string> statements = statements_;
    statements.push_back(outlines_text(before, after));
    for (const fit::Estimate& estimate : known.estimates) {
      if (!estimate.statement.empty()) statements.push_back(estimate.statement);
    }
    statements.insert(statements.end(), known.statements.begin(), known.statements.end());
    Json sizes = Json::array();
    for (const ImageSighting& sighting : sightings_) {
      const Json one = {{"capture", sighting.capture},
                        {"camera", sighting.camera_number},
                        {"particle_size", sighting.reduced.view.size}};
      if (std::find(sizes.begin(), sizes.end(), one) == sizes.end()) sizes.push_back(one);
    }
    const BodyDoc& body = job_.scene.bodies.front();
    const Json none = {{"fitted", nullptr}, {"held_out", nullptr}};
    Json json = {{"law", material::traits(body.material.law).name},
                 {"converged", state_.converged},
                 {"reason", state_.reason},
                 {"loss", "silhouette"},
                 {"iterations", iterations_},
                 {"evaluations", simulated_},
                 {"seconds", seconds},
                 {"parameters", parameters_json(search_->parameters(), values_, known)},
                 {"correlation", correlation_json(known)},
                 {"noise_scale", known.noise_scale},
                 {"statements", statements},
                 {"before", none},
                 {"after", none},
                 {"silhouettes", {{"before", before}, {"after", after}}},
                 {"cameras", sizes},
                 {"history", history_}};
    json["warning"] = fit_warning(json, false);
    return json;
  }

  Json simulate(const Json& document, const Json& fit) {
    ReadOptions read;
    read.base_folder = job_.base_folder;
    const Job scene = read_job(document.dump(), read);
    RunExtras extras;
    extras.task = task_name(Task::kFit);
    extras.begin = kFitShare;
    extras.finish = [&](Json& result) {
      result["fit"] = fit;
      return write_materials(job_.output.folder, scene,
                             fitted_bodies(doc_, scene.scene.bodies.front().name), fit);
    };
    RunOptions options = options_;
    if (options.restart == Restart::kNever) options.restart = Restart::kWhereChanged;
    return run_scenes(scene, options, interrupter_, extras);
  }

  const Job& job_;
  const FitDoc& doc_;
  RunOptions options_;
  Interrupter& interrupter_;
  LoadedExperiment loaded_;
  std::vector<std::string> statements_;
  std::vector<ImageSighting> sightings_;
  std::optional<fit::Parameters> parameters_;
  std::unique_ptr<fit::SilhouetteModel> model_;
  double until_ = 0.0;  ///< [s] of the last image that is fitted
  std::vector<double> values_;
  std::optional<fit::LeastSquares> search_;
  fit::LeastSquaresState state_;
  std::vector<Json> history_;
  int simulated_ = 0;
  int iterations_ = 0;
};

}  // namespace

Json run_silhouette_fit(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  return SilhouetteFit(job, options, interrupter).run();
}

}  // namespace matterfit::job
