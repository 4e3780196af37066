// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "base/clock.hpp"
#include "base/error.hpp"
#include "fit/model/image_problem.hpp"
#include "fit/model/particle_colours.hpp"
#include "fit/model/particle_sizes.hpp"
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

constexpr double kImageFitShare = 0.9;
constexpr double kNarrow = 1.0;  ///< blurs [reduced pixels]
constexpr double kWide = 4.0;
/// Factors at which a stiffness is tried that nothing is known of.
constexpr double kScan[] = {1.0 / 64, 1.0 / 16, 0.25, 4.0, 16.0, 64.0};

/// One fit of a job's images and, where it has any, tracks.
class ImageFit {
 public:
  ImageFit(const Job& job, const RunOptions& options, Interrupter& interrupter)
      : job_(job), doc_(fit_of(job)), options_(options), interrupter_(interrupter) {}

  Json run() {
    const auto begin = Clock::now();
    if (!doc_.laws.empty()) {
      throw_input("fit.laws: laws are compared by tracks only; a fit to images takes one.");
    }
    if (doc_.correction > 0) {
      throw_input("fit.correction: it is judged by tracks only; leave it out of a fit to images.");
    }
    say("Reading", 0.0);
    loaded_ =
        job_.captures.empty() ? unread_experiment(job_) : load_experiment(job_, statements_, true);
    build();
    say("Fitting: the start", 0.01);
    values_ = parameters_->starts();
    settle_steps();
    settle_sizes();
    const Standing before = standing();
    find_poses();
    learn_colours();
    scan();
    search(kWide, "wide");
    if (moves_cameras()) settle_sizes();
    learn_colours();
    search(kNarrow, "narrow");
    say("Fitting: errors of the values", 0.95 * kImageFitShare);
    const fit::Uncertainty known = uncertainty();
    const Standing after = standing();
    Json document = document_to_simulate(job_, job_.output.folder);
    write_values(*parameters_, values_, loaded_.sources, job_, document);
    return simulate(document, fit_json(known, before, after, seconds_since(begin)));
  }

 private:
  /// How well a simulation agrees with what was recorded.
  struct Standing {
    Json silhouettes = {{"fitted", nullptr}, {"held_out", nullptr}};
    Json cameras = Json::array();
    Json tracks = {{"fitted", nullptr}, {"held_out", nullptr}};
  };

  void say(const std::string& label, double fraction) {
    enter_stage(interrupter_, label, fraction);
  }

  [[nodiscard]] std::vector<fit::Run>& runs() { return loaded_.experiment.runs; }

  void build() {
    say("Filling bodies", 0.0);
    Arena arena(options_.threads);
    std::vector<mpm::Scene> scenes;
    for (const fit::Run& run : runs()) scenes.push_back(run.build(1.0, arena, interrupter_));
    has_tracks_ =
        std::any_of(runs().begin(), runs().end(), [](const fit::Run& run) { return run.fitted; });
    films_ = load_films(job_, scenes.front(), has_tracks_, statements_, interrupter_);
    settle_captures(loaded_.experiment, scenes, arena, statements_);
    window_ = fit::growing_windows(runs(), false).back();
    runs().front().films = films_.films;
    runs().front().fitted = true;
    parameters_.emplace(with_poses(job_, films_, doc_.parameters), runs(), scenes);
    fit::Model::Options options;
    options.loss = doc_.loss;
    options.target = resolve_target(options_.target);
    options.threads = options_.threads;
    options.memory_limit_gb = job_.scene.solver.memory_limit_gb;
    model_ = std::make_unique<fit::Model>(runs(), std::move(scenes), *parameters_, options,
                                          interrupter_);
    if (has_tracks_) {
      tracks_.emplace(*model_, runs(), parameters_->parameters(), doc_.loss, window_,
                      fit::used_samples(runs()));
    }
  }

  /// From here on every run takes the substeps that the solver chooses at the present values.
  void settle_steps() {
    double until = 0.0;
    for (const ImageSighting& sighting : films_.sightings) {
      if (!sighting.reduced.held_out) until = std::max(until, sighting.reduced.view.time);
    }
    fit::Scope scope;
    scope.until = window_.until;
    scope.until.front() = std::max(scope.until.front(), until);
    const fit::Evaluation evaluation = model_->evaluate({values_}, scope);
    if (!evaluation.outcomes.front()) {
      if (evaluation.failure.by_input) throw_input(evaluation.failure.message);
      throw_compute(evaluation.failure.message);
    }
    plan_ = model_->plan_of(values_, *evaluation.outcomes.front());
  }

  /// The cameras whose pose is fitted, by film.
  [[nodiscard]] std::vector<std::vector<std::uint8_t>> moved_cameras() const {
    std::vector<std::vector<std::uint8_t>> moved;
    for (const fit::Film& film : films_.films) {
      std::vector<std::uint8_t>& of = moved.emplace_back(film.viewing.poses.size(), 0);
      for (std::size_t k = 0; k < parameters_->size(); ++k) {
        const fit::Address& path = parameters_->path(k);
        if (path.owner == film.name && is_of_camera(path)) of[path.index] = 1;
      }
    }
    return moved;
  }
  [[nodiscard]] static bool is_of_camera(const fit::Address& path) {
    return path.quantity->path.starts_with("poses");
  }
  [[nodiscard]] bool moves_cameras() const {
    for (std::size_t k = 0; k < parameters_->size(); ++k) {
      if (is_of_camera(parameters_->path(k))) return true;
    }
    return false;
  }

  void settle_sizes() {
    std::vector<fit::Sighting> reduced;
    reduced.reserve(films_.sightings.size());
    for (const ImageSighting& sighting : films_.sightings) reduced.push_back(sighting.reduced);
    fit::settle_sizes(*model_, values_, films_.paths, moved_cameras(), reduced);
    for (std::size_t k = 0; k < reduced.size(); ++k) {
      films_.sightings[k].reduced.view.size = reduced[k].view.size;
    }
  }

  /// Of the particles, from the images at the scene's first frame as the values have them now.
  void learn_colours() {
    std::vector<fit::Sighting> reduced;
    for (const ImageSighting& sighting : films_.sightings) {
      const bool tells = sighting.reduced.has_colours() && !sighting.reduced.held_out;
      if (tells) reduced.push_back(sighting.reduced);
    }
    if (!reduced.empty()) colours_ = fit::learn_colours(*model_, values_, reduced, interrupter_);
  }

  [[nodiscard]] std::vector<fit::Parameter> parameters_at(const std::vector<double>& values) const {
    std::vector<fit::Parameter> parameters = parameters_->parameters();
    for (std::size_t k = 0; k < values.size(); ++k) parameters[k].start = values[k];
    return parameters;
  }

  /// Of all that is fitted.
  [[nodiscard]] fit::ImageProblem problem(double blur) {
    fit::ImageProblem::Parts parts;
    parts.tracks = tracks_ ? &*tracks_ : nullptr;
    parts.window = window_;
    parts.colours = colours_ ? &*colours_ : nullptr;
    return problem(blur, std::move(parts), std::numeric_limits<double>::infinity());
  }

  /// With the images up to a time [s].
  [[nodiscard]] fit::ImageProblem problem(double blur, fit::ImageProblem::Parts parts,
                                          double until) {
    for (const ImageSighting& sighting : films_.sightings) {
      const bool used = !sighting.reduced.held_out && sighting.reduced.view.time <= until;
      if (used) parts.sightings.push_back(sighting.reduced);
    }
    fit::ImageProblem result(*model_, parameters_at(values_), std::move(parts), blur);
    result.set_plan(plan_);
    result.simulated = [this](int count) {
      // How many there will be is not known: half of what is left with every forty.
      const double part = 1.0 - std::exp2(-double(simulated_ + count) / 40.0);
      say("Fitting", 0.9 * kImageFitShare * part);
    };
    return result;
  }

  /// Poses of cameras from the images at the scene's first frame: nothing has moved there, so they
  /// tell of poses and of where the bodies stand alone, and cost no simulation.
  void find_poses() {
    const bool any = std::any_of(
        films_.sightings.begin(), films_.sightings.end(), [](const ImageSighting& sighting) {
          return !sighting.reduced.held_out && sighting.reduced.view.time == 0.0;
        });
    if (!any || !moves_cameras()) return;
    for (const double blur : {kWide, kNarrow}) {
      fit::ImageProblem::Parts parts;
      parts.window.until.assign(runs().size(), -1.0);
      search(problem(blur, std::move(parts), 0.0), "poses");
      settle_sizes();
    }
  }

  /// Starts of stiffness that nothing is known of: the best of some factors off the scene's.
  void scan() {
    fit::ImageProblem at = problem(kWide);
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

  /// Refines the plan as the values now need it; residuals are then not quite the same.
  void settle(fit::ImageProblem& at) {
    fit::StepPlan plan = at.plan();
    model_->settle(plan, at.physical(state_.point), at.plan().refinements);
    if (plan.refinements == at.plan().refinements) return;
    at.set_plan(std::move(plan));
    state_.residual.resize(0);
    state_.forget_slopes();
  }

  void search(double blur, const char* stage) {
    settle_steps();
    search(problem(blur), stage);
  }

  void search(fit::ImageProblem at, const char* stage) {
    fit::LeastSquaresOptions options;
    options.huber = doc_.huber;
    options.iterations = doc_.iterations;
    search_.emplace(parameters_at(values_), options);
    state_ = search_->start();
    while (!state_.finished) {
      settle(at);
      try {
        search_->iterate(at, state_);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCompute || at.failure().empty()) throw;
        throw_compute(std::string(error.what()) + " " + at.failure());
      }
      history_.push_back({{"stage", stage},
                          {"iteration", state_.iteration},
                          {"cost", state_.cost},
                          {"values", at.physical(state_.point)}});
    }
    values_ = at.physical(state_.point);
    simulated_ += state_.evaluations;
    iterations_ += state_.iteration;
  }

  [[nodiscard]] fit::Uncertainty uncertainty() {
    fit::ImageProblem at = problem(kNarrow);
    settle(at);
    search_->linearise(at, state_);
    misfit_ = at.misfit(state_.residual);
    // Without Huber's bound, which is one of residuals that are not counted yet.
    return fit::uncertainty(search_->parameters(), at.as_counted(state_),
                            at.effective(state_.residual), 0.0, at.blocks());
  }

  /// At the present values: of all images, in their own pixels, and of all tracks.
  [[nodiscard]] Standing standing() {
    const std::vector<ImageSighting>& sightings = films_.sightings;
    std::vector<fit::Agreement> agreements(sightings.size());
    fit::Filming filming;
    for (const ImageSighting& sighting : sightings) {
      filming.views.push_back(sighting.reduced.view);
      filming.views.back().camera = sighting.camera;
    }
    filming.see = [&](std::size_t, std::size_t v, const fit::Drawn& image) {
      const ImageSighting& sighting = sightings[v];
      std::vector<float> ours = image.mask;
      for (std::size_t i = 0; i < sighting.seen.size(); ++i) {
        if (sighting.seen[i] == 0) ours[i] = 0.0F;
      }
      agreements[v] =
          fit::agreement(ours, sighting.matte, sighting.camera.width, sighting.camera.height);
    };
    fit::Scope scope = fit::whole_scope(runs());
    scope.until.front() = std::max(scope.until.front(), filming.until());
    scope.filming = &filming;
    scope.plan = &plan_;
    const fit::Evaluation evaluation = model_->evaluate({values_}, scope);
    Standing standing;
    if (!evaluation.outcomes.front()) return standing;
    standing.silhouettes = silhouettes_json(sightings, agreements);
    standing.cameras = cameras_json(films_, agreements);
    if (!job_.captures.empty()) {
      standing.tracks = errors_of(runs(), *model_, doc_.loss, *evaluation.outcomes.front()).json();
    }
    return standing;
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

  /// Where one kind of recording is missed by far more of its noise than the other it is given too
  /// much weight.
  [[nodiscard]] std::string weights_text() const {
    constexpr double kApart = 3.0;
    const double images = std::sqrt(misfit_.images);
    const double tracks = std::sqrt(misfit_.tracks);
    const bool apart = std::max(images, tracks) > kApart * std::max(1.0, std::min(images, tracks));
    if (!has_tracks_ || !apart) return "";
    return fmt::format(
        "The images are missed by {:.2g} times their noise, the tracks by {:.2g} times theirs: the "
        "{} count for too much. Give their captures a larger 'noise', or look for what they show "
        "and the scene lacks.",
        images, tracks, images > tracks ? "images" : "tracks");
  }

  [[nodiscard]] Json fit_json(const fit::Uncertainty& known, const Standing& before,
                              const Standing& after, double seconds) {
    std::vector<std::string> statements = statements_;
    statements.push_back(outlines_text(before.silhouettes, after.silhouettes));
    if (const std::string text = weights_text(); !text.empty()) statements.push_back(text);
    for (const fit::Estimate& estimate : known.estimates) {
      if (!estimate.statement.empty()) statements.push_back(estimate.statement);
    }
    statements.insert(statements.end(), known.statements.begin(), known.statements.end());
    const BodyDoc& body = job_.scene.bodies.front();
    const auto scale = [](double square) {
      return std::isfinite(square) ? Json(std::sqrt(square)) : Json();
    };
    Json json = {{"law", material::traits(body.material.law).name},
                 {"converged", state_.converged},
                 {"reason", state_.reason},
                 {"loss", std::string("silhouette") +
                              (has_tracks_ ? " and " + std::string(loss_name(doc_.loss)) : "")},
                 {"iterations", iterations_},
                 {"evaluations", simulated_},
                 {"seconds", seconds},
                 {"parameters", parameters_json(parameters_->parameters(), values_, known)},
                 {"correlation", correlation_json(known)},
                 {"noise_scale", known.noise_scale},
                 {"noise_scales",
                  {{"images", scale(misfit_.images)},
                   {"colours", scale(misfit_.colours)},
                   {"tracks", scale(misfit_.tracks)}}},
                 {"statements", statements},
                 {"before", before.tracks},
                 {"after", after.tracks},
                 {"silhouettes", {{"before", before.silhouettes}, {"after", after.silhouettes}}},
                 {"cameras", after.cameras},
                 {"history", history_}};
    json["warning"] = fit_warning(json, false);
    const std::string held_out = held_out_warning(after.tracks);
    if (!held_out.empty()) {
      const auto warning = json.at("warning").get<std::string>();
      json["warning"] = warning.empty() ? held_out : warning + " " + held_out;
    }
    return json;
  }

  Json simulate(const Json& document, const Json& fit) {
    ReadOptions read;
    read.base_folder = job_.base_folder;
    const Job scene = read_job(document.dump(), read);
    Job fitted = scene;
    if (!fitted.captures.empty()) fitted.task = Task::kCompare;
    RunExtras extras;
    extras.task = task_name(Task::kFit);
    extras.begin = kImageFitShare;
    extras.clouds = doc_.loss != FitDoc::Loss::kTracks;
    extras.finish = [&](Json& result) {
      result["fit"] = fit;
      return write_materials(job_.output.folder, scene,
                             fitted_bodies(doc_, scene.scene.bodies.front().name), fit);
    };
    RunOptions options = options_;
    if (options.restart == Restart::kNever) options.restart = Restart::kWhereChanged;
    return run_scenes(fitted, options, interrupter_, extras);
  }

  const Job& job_;
  const FitDoc& doc_;
  RunOptions options_;
  Interrupter& interrupter_;
  LoadedExperiment loaded_;
  std::vector<std::string> statements_;
  LoadedFilms films_;
  bool has_tracks_ = false;  ///< that are fitted
  fit::Window window_;       ///< of the tracks
  std::optional<fit::Parameters> parameters_;
  std::unique_ptr<fit::Model> model_;
  std::optional<fit::CaptureProblem> tracks_;
  std::optional<fit::ParticleColours> colours_;
  fit::StepPlan plan_;
  std::vector<double> values_;
  std::optional<fit::LeastSquares> search_;
  fit::LeastSquaresState state_;
  fit::ImageProblem::Misfit misfit_;
  std::vector<Json> history_;
  int simulated_ = 0;
  int iterations_ = 0;
};

}  // namespace

Json run_image_fit(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  return ImageFit(job, options, interrupter).run();
}

}  // namespace matterfit::job
