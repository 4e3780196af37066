// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_experiment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include "base/error.hpp"
#include "job/documents/inputs.hpp"
#include "job/fit_report.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/own_splats.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {
namespace {

bool is_of_camera(const fit::Address& path) { return path.quantity->is_pose(); }

bool is_of_throw(const fit::Address& path) {
  return path.quantity == &fit::row_named(fit::Owner::kBody, "velocity") ||
         path.quantity == &fit::row_named(fit::Owner::kBody, "spin");
}

}  // namespace

ImageExperiment::ImageExperiment(const Job& job, const FitDoc& fit, const RunOptions& options,
                                 const Interrupter& interrupter,
                                 std::vector<std::string>& statements)
    : job_(job), doc_(fit), options_(options), interrupter_(interrupter) {
  loaded_ = job.captures.empty() ? unread_experiment(job) : load_experiment(job, statements, true);
  for (const fit::Run& run : runs()) builders_.push_back(run.build);
  std::vector<mpm::Scene> scenes = build_scenes(1.0);
  has_tracks_ =
      std::any_of(runs().begin(), runs().end(), [](const fit::Run& run) { return run.fitted; });
  films_ = load_films(job, scenes.front(), has_tracks_ ? FilmUse::kBesideMore : FilmUse::kFitted,
                      statements, interrupter);
  Arena arena(options.threads);
  settle_captures(loaded_.experiment, scenes, arena, statements);
  window_ = fit::growing_windows(runs(), false).back();
  runs().front().films = films_.films;
  runs().front().splats = own_splats(job);
  runs().front().fitted = true;
  make_parameters(scenes, {});
  at_ = resolution(std::move(scenes));
}

std::vector<mpm::Scene> ImageExperiment::build_scenes(double level) const {
  Arena arena(options_.threads);
  std::vector<mpm::Scene> scenes;
  for (const fit::Run& run : loaded_.experiment.runs) {
    scenes.push_back(run.build(level, arena, interrupter_));
  }
  return scenes;
}

void ImageExperiment::make_parameters(const std::vector<mpm::Scene>& scenes,
                                      std::vector<fit::ParameterSpec> more) {
  std::vector<fit::ParameterSpec> specs = with_poses(job_, films_, doc_.parameters);
  std::ranges::move(more, std::back_inserter(specs));
  parameters_.emplace(std::move(specs), runs(), scenes);
}

std::unique_ptr<ImageExperiment::Resolution> ImageExperiment::resolution(
    std::vector<mpm::Scene> scenes) {
  auto made = std::make_unique<Resolution>();
  fit::Model::Options given;
  given.loss = doc_.loss;
  given.target = resolve_target(options_.target);
  given.threads = options_.threads;
  given.memory_limit_gb = memory_left(scenes);
  made->model =
      std::make_unique<fit::Model>(runs(), std::move(scenes), *parameters_, given, interrupter_);
  films_.mark_splats(made->model->own(0), made->model->scene(0));
  if (has_tracks_) {
    made->tracks.emplace(*made->model, runs(), parameters_->parameters(), doc_.loss, window_,
                         fit::used_samples(runs()));
  }
  return made;
}

void ImageExperiment::extend(const std::function<fit::SceneBuilder(fit::SceneBuilder)>& with,
                             std::vector<fit::ParameterSpec> more) {
  for (std::size_t r = 0; r < builders_.size(); ++r) {
    runs()[r].build = with ? with(builders_[r]) : builders_[r];
  }
  std::vector<mpm::Scene> scenes = build_scenes(1.0);
  std::optional<fit::ParticleColours> colours = std::move(at_->colours);
  fit::StepPlan plan = std::move(at_->plan);
  at_.reset();
  make_parameters(scenes, std::move(more));
  at_ = resolution(std::move(scenes));
  at_->colours = std::move(colours);
  at_->plan = std::move(plan);
}

double ImageExperiment::memory_left(const std::vector<mpm::Scene>& scenes) const {
  std::vector<fit::Sighting> reduced;
  std::vector<fit::View> whole;
  for (const ImageSighting& sighting : films_.sightings) {
    reduced.push_back(sighting.reduced);
    whole.push_back(sighting.whole());
  }
  const fit::ImageProblem::Memory memory = fit::ImageProblem::memory(reduced, parameters_->size());
  double simulation = 0.0;
  for (const mpm::Scene& scene : scenes) {
    simulation = std::max(simulation, double(mpm::Simulation::estimate(scene).bytes));
  }
  std::size_t splats = 0;
  for (const fit::BodySplats& one : loaded_.experiment.runs.front().splats) {
    splats += one.splats.size();
  }
  simulation += fit::Filmer::bytes(scenes.front(), whole, splats);
  const double limit = 1e9 * job_.scene.solver.memory_limit_gb;
  const double held = memory.images + memory.slopes;
  if (held + simulation <= limit) return 1e-9 * (limit - held);
  throw_input(fmt::format(
      "scene.solver.memory_limit_gb: the fit needs about {:.3g} GB, the limit is {:.3g} GB: {:.3g} "
      "for {} images as they are compared, {:.3g} for how {:.3g} million residuals change with {} "
      "parameters, {:.3g} for a simulation. Hold out frames or cameras, leave 'colours' or "
      "parameters out, use a larger scene.particle_separation, or raise the limit.",
      1e-9 * (held + simulation), 1e-9 * limit, 1e-9 * memory.images, reduced.size(),
      1e-9 * memory.slopes, 1e-6 * memory.residuals, parameters_->size(), 1e-9 * simulation));
}

bool ImageExperiment::moves_cameras() const {
  for (std::size_t k = 0; k < parameters_->size(); ++k) {
    if (is_of_camera(parameters_->path(k))) return true;
  }
  return false;
}

std::vector<std::vector<std::uint8_t>> ImageExperiment::moved_cameras() const {
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

void ImageExperiment::settle_steps(const std::vector<double>& values) {
  double until = 0.0;
  for (const ImageSighting& sighting : films_.sightings) {
    if (!sighting.reduced.held_out) until = std::max(until, sighting.reduced.view.time);
  }
  fit::Scope scope;
  scope.until = window_.until;
  scope.until.front() = std::max(scope.until.front(), until);
  const fit::Evaluation evaluation = at_->model->evaluate({values}, scope);
  if (!evaluation.outcomes.front()) {
    if (evaluation.failure.by_input) throw_input(evaluation.failure.message);
    throw_compute(evaluation.failure.message);
  }
  at_->plan = at_->model->plan_of(values, *evaluation.outcomes.front());
}

void ImageExperiment::settle_sizes(const std::vector<double>& values) {
  const auto film = [&](const fit::Filming& filming) {
    fit::Scope scope;
    scope.until.assign(runs().size(), -1.0);
    scope.until.front() = filming.until();
    scope.filming = &filming;
    const fit::Evaluation evaluation = at_->model->evaluate({values}, scope);
    if (!evaluation.outcomes.front()) throw_compute(evaluation.failure.message);
  };
  films_.settle_sizes(film, moved_cameras());
}

bool ImageExperiment::learn_colours(const std::vector<double>& values) {
  std::vector<fit::Sighting> reduced;
  for (const ImageSighting& sighting : films_.sightings) {
    const bool tells = sighting.reduced.has_colours() && !sighting.reduced.held_out;
    if (!tells) continue;
    fit::View& view = reduced.emplace_back(sighting.reduced).view;
    view.camera = at_->model->camera_of(values, view);
  }
  if (reduced.empty()) return false;
  at_->colours = fit::learn_colours(at_->model->scene_at(values, 0), at_->model->own(0), reduced,
                                    std::make_shared<Arena>(at_->model->threads()),
                                    at_->model->target(), interrupter_);
  return true;
}

Eigen::VectorXd ImageExperiment::natural(const std::vector<double>& values) const {
  Eigen::VectorXd point(Eigen::Index(values.size()));
  for (std::size_t k = 0; k < values.size(); ++k) {
    point[Eigen::Index(k)] = fit::to_natural(parameters_->parameters()[k].coordinate, values[k]);
  }
  return point;
}

std::vector<fit::Parameter> ImageExperiment::parameters_from(
    const std::vector<double>& values) const {
  std::vector<fit::Parameter> parameters = parameters_->parameters();
  for (std::size_t k = 0; k < values.size(); ++k) parameters[k].start = values[k];
  return parameters;
}

std::vector<fit::Parameter> ImageExperiment::motion_from(const std::vector<double>& values) const {
  constexpr double kHeld = 0.02;  // scales
  std::vector<fit::Parameter> parameters = parameters_from(values);
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (is_of_throw(parameters_->path(k)) || is_of_camera(parameters_->path(k))) continue;
    fit::Parameter& parameter = parameters[k];
    const double start = std::clamp(parameter.start, parameter.low, parameter.high);
    parameter.prior =
        fit::Prior{fit::to_natural(parameter.coordinate, start), kHeld * parameter.scale};
  }
  return parameters;
}

fit::ImageProblem ImageExperiment::problem(const std::vector<double>& values, double blur) {
  fit::ImageProblem::Parts parts;
  parts.tracks = at_->tracks ? &*at_->tracks : nullptr;
  parts.window = window_;
  parts.colours = at_->colours ? &*at_->colours : nullptr;
  return problem(values, blur, std::move(parts), std::numeric_limits<double>::infinity());
}

fit::ImageProblem ImageExperiment::first_frame(const std::vector<double>& values, double blur) {
  return beginning(values, blur, 0.0);
}

fit::ImageProblem ImageExperiment::beginning(const std::vector<double>& values, double blur,
                                             double until) {
  fit::ImageProblem::Parts parts;
  parts.window.until.assign(runs().size(), -1.0);
  parts.colours = at_->colours ? &*at_->colours : nullptr;
  return problem(values, blur, std::move(parts), until);
}

bool ImageExperiment::finds_throw() const {
  for (std::size_t k = 0; k < parameters_->size(); ++k) {
    if (is_of_throw(parameters_->path(k))) return true;
  }
  return false;
}

std::vector<double> ImageExperiment::later_times() const {
  std::vector<double> times;
  for (const ImageSighting& sighting : films_.sightings) {
    const fit::Sighting& reduced = sighting.reduced;
    if (!reduced.held_out && reduced.view.time > 0.0) times.push_back(reduced.view.time);
  }
  std::ranges::sort(times);
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

bool ImageExperiment::sees_first_frame() const {
  return std::ranges::any_of(films_.sightings, [](const ImageSighting& sighting) {
    return !sighting.reduced.held_out && sighting.reduced.view.time == 0.0;
  });
}

fit::ImageProblem ImageExperiment::problem(const std::vector<double>& values, double blur,
                                           fit::ImageProblem::Parts parts, double until) {
  for (const ImageSighting& sighting : films_.sightings) {
    const bool used = !sighting.reduced.held_out && sighting.reduced.view.time <= until;
    if (used) parts.sightings.push_back(sighting.reduced);
  }
  fit::ImageProblem result(*at_->model, parameters_from(values), std::move(parts), blur);
  result.set_plan(at_->plan);
  return result;
}

ImageStanding ImageExperiment::standing(const std::vector<double>& values) {
  const std::vector<ImageSighting>& sightings = films_.sightings;
  std::vector<fit::Agreement> agreements(sightings.size());
  fit::Filming filming;
  for (const ImageSighting& sighting : sightings) {
    filming.views.push_back(sighting.whole());
  }
  filming.see = [&](std::size_t, std::size_t v, const fit::Drawn& image) {
    agreements[v] = films_.agreement(v, image.mask);
  };
  fit::Scope scope = fit::whole_scope(runs());
  scope.until.front() = std::max(scope.until.front(), filming.until());
  scope.filming = &filming;
  scope.plan = &at_->plan;
  const fit::Evaluation evaluation = at_->model->evaluate({values}, scope);
  ImageStanding standing;
  if (!evaluation.outcomes.front()) return standing;
  standing.silhouettes = silhouettes_json(sightings, agreements);
  standing.cameras = cameras_json(films_, agreements);
  if (!job_.captures.empty()) {
    standing.tracks =
        errors_of(runs(), *at_->model, doc_.loss, *evaluation.outcomes.front()).json();
  }
  return standing;
}

Eigen::VectorXd ImageExperiment::residuals_at(double level, const std::vector<double>& values,
                                              double blur, const std::function<void()>& settle) {
  /// Puts the resolution of the document back.
  struct Back {
    ImageExperiment& of;
    std::unique_ptr<Resolution> own;
    std::vector<double> sizes;
    ~Back() {
      of.at_ = std::move(own);
      for (std::size_t k = 0; k < sizes.size(); ++k) {
        of.films_.sightings[k].reduced.view.size = sizes[k];
      }
    }
  };
  std::unique_ptr<Resolution> coarse = resolution(build_scenes(level));
  Back back{*this, std::move(at_), {}};
  at_ = std::move(coarse);
  for (const ImageSighting& sighting : films_.sightings) {
    back.sizes.push_back(sighting.reduced.view.size);
  }
  settle();
  fit::ImageProblem coarser = problem(values, blur);
  std::optional<Eigen::VectorXd> found = coarser.evaluate({natural(values)}).front();
  if (!found) throw_compute(coarser.failure());
  return *std::move(found);
}

}  // namespace matterfit::job
