// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/model.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "base/error.hpp"
#include "base/side_by_side.hpp"
#include "fit/model/model_trial.hpp"
#include "material/neural/published_material.hpp"
#include "mpm/step_limit.hpp"

namespace matterfit::fit {
namespace {

constexpr int kMoreTries = 2;

}  // namespace

Scope whole_scope(const std::vector<Run>& runs) {
  Scope scope;
  scope.until.reserve(runs.size());
  for (const Run& run : runs) scope.until.push_back(run.captures.empty() ? -1.0 : run.clock.end());
  return scope;
}

Model::Model(const std::vector<Run>& runs, std::vector<mpm::Scene> scenes,
             const Parameters& parameters, const Options& options, const Interrupter& interrupter)
    : runs_(runs), parameters_(parameters), options_(options), interrupter_(interrupter) {
  if (options_.threads < 1) {
    options_.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  }
  Arena arena(options_.threads);
  models_.reserve(runs.size());
  for (std::size_t r = 0; r < runs.size(); ++r) {
    auto model = std::make_unique<RunModel>();
    model->scene = std::move(scenes[r]);
    for (const Capture& capture : runs[r].captures) {
      Points rest = watched_points(model->scene, capture, options_.loss, arena);
      model->watchers.emplace_back(model->scene, capture.input, options_.loss, rest, arena);
      model->watched.push_back(std::move(rest));
    }
    model->own = carried(runs[r].splats, model->scene, arena, &interrupter_);
    bytes_ = std::max(bytes_, mpm::Simulation::estimate(model->scene).bytes);
    models_.push_back(std::move(model));
  }
}

Model::~Model() = default;

std::span<const OwnSplats> Model::own(std::size_t run) const { return models_[run]->own; }

const mpm::Scene& Model::scene(std::size_t run) const { return models_[run]->scene; }

mpm::Scene Model::scene_at(std::span<const double> values, std::size_t run) const {
  mpm::Scene scene = models_[run]->scene;
  parameters_.apply(values, run, scene);
  for (mpm::Body& body : scene.bodies) {
    // Contact and the substep are to follow.
    if (body.material.published) material::settle_moves(body.material);
  }
  return scene;
}

splat::Camera Model::camera_of(std::span<const double> values, const View& view) const {
  return posed(view.camera, parameters_.film_viewing(values, 0, view.film).poses[view.number]);
}

StepPlan Model::plan_of(std::span<const double> values, const Outcome& outcome) const {
  std::vector<RunSteps> runs(models_.size());
  for (std::size_t r = 0; r < models_.size(); ++r) {
    if (outcome[r].substeps.empty()) continue;
    runs[r] = {with_neighbours(outcome[r].substeps), mpm::step_limit(scene_at(values, r)),
               outcome[r].renewals};
  }
  return StepPlan(std::move(runs));
}

void Model::settle(StepPlan& plan, std::span<const double> values,
                   std::span<const int> before) const {
  for (std::size_t r = 0; r < models_.size(); ++r) {
    if (!plan.holds(r)) continue;
    plan.settle(r, scene_at(values, r), before.empty() ? nullptr : &before[r]);
  }
}

Points Model::placed_points(std::size_t run, const Query& query, const std::string& body,
                            Points points) const {
  mpm::Body moved;
  moved.name = body;
  moved.rest = std::move(points);
  mpm::Scene alone;
  alone.bodies.push_back(parameters_.placed(query.values, run, std::move(moved)));
  vary_places(query.variation, runs_[run], alone);
  return std::move(alone.bodies.front().rest);
}

void Model::carry_splats(std::size_t run, const Query& query, Trial& trial, Arena& arena) const {
  trial.own = models_[run]->own;
  const auto is_placed = [&](std::size_t body) {
    const mpm::Body& of = trial.scene.bodies[body];
    return parameters_.places(run, of.name) || places(query.variation, of);
  };
  if (std::none_of(trial.own.begin(), trial.own.end(),
                   [&](const OwnSplats& one) { return is_placed(one.body); })) {
    return;
  }
  std::vector<BodySplats> all = runs_[run].splats;
  for (BodySplats& one : all) {
    Vec3d to = Vec3d::Zero();
    Mat3d axes = Mat3d::Identity();
    if (is_placed(one.body)) {
      const Points moved = placed_points(run, query, trial.scene.bodies[one.body].name,
                                         {Vec3d(Vec3d::Zero()), Vec3d(Vec3d::UnitX()),
                                          Vec3d(Vec3d::UnitY()), Vec3d(Vec3d::UnitZ())});
      to = moved[0];
      for (int k = 0; k < 3; ++k) axes.col(k) = moved[std::size_t(k) + 1] - moved[0];
    }
    const double scale = std::cbrt(axes.determinant());
    one.splats =
        capture::placed(std::move(one.splats), to + trial.shift, Quatd(Mat3d(axes / scale)), scale);
  }
  trial.moved_own = carried(all, trial.scene, arena, &interrupter_);
  trial.own = trial.moved_own;
}

Model::Trial Model::trial(std::size_t run, const Query& query, const Scope& scope,
                          Arena& arena) const {
  const RunModel& model = *models_[run];
  const Run& of = runs_[run];
  Trial trial;
  trial.scene = scene_at(query.values, run);
  mpm::Scene& scene = trial.scene;
  trial.watchers = model.watchers;
  trial.shift = world_shift(query.variation.grid_shift, scene);
  vary(query.variation, of, scene);
  const bool placed =
      std::any_of(scene.bodies.begin(), scene.bodies.end(), [&](const mpm::Body& body) {
        return parameters_.places(run, body.name) || places(query.variation, body);
      });
  if (placed) {
    trial.moved.reserve(of.captures.size());
    for (std::size_t c = 0; c < of.captures.size(); ++c) {
      const Capture& capture = of.captures[c];
      Points rest = model.watched[c];
      if (options_.loss == Loss::kSurface || capture.places_given) {
        rest = placed_points(run, query, capture.input.body, std::move(rest));
      }
      if (!trial.shift.isZero(0.0)) {
        for (Vec3d& x : rest) x += trial.shift;
      }
      trial.moved.emplace_back(scene, capture.input, options_.loss, std::move(rest), arena);
    }
    trial.watchers = trial.moved;
  }
  const int last = scene.end_frame - 1 - scene.first_frame;
  const double end = last / scene.fps;
  double latest = 0.0;
  for (std::size_t c = 0; c < of.captures.size(); ++c) {
    const Capture& capture = of.captures[c];
    const Viewing viewing =
        varied(query.variation, of, c, parameters_.viewing(query.values, run, c));
    const double delay = (viewing.start_frame - capture.viewing.start_frame) / scene.fps;
    latest = std::max(latest, delay);
    std::vector<double> times = capture.input.tracks.times;
    // What a delay brings to beyond the simulated time is compared with its end.
    for (double& time : times) {
      const bool inside = time >= 0.0 && time <= end;
      time += delay;
      if (inside) time = std::clamp(time, 0.0, end);
    }
    trial.times.push_back(std::move(times));
  }
  double until = scope.until[run] + latest;
  if (scope.filming != nullptr && scope.filming->run == run) {
    for (std::size_t f = 0; f < of.films.size(); ++f) {
      trial.films.push_back(parameters_.film_viewing(query.values, run, f));
    }
    for (const View& view : scope.filming->views) {
      const double delay =
          (trial.films[view.film].start_frame - of.films[view.film].viewing.start_frame) /
          scene.fps;
      trial.view_times.push_back(std::clamp(view.time + delay, 0.0, end));
      until = std::max(until, trial.view_times.back());
    }
    carry_splats(run, query, trial, arena);
  }
  trial.frames = std::min(last, int(std::ceil(until * scene.fps - 1e-6)));
  if (scope.plan == nullptr || scene.dt > 0.0 || !scope.plan->holds(run)) return trial;
  trial.steps = &scope.plan->runs[run];
  trial.finer = scope.plan->factor(run, scene) / query.variation.dt_factor;
  return trial;
}

Observation Model::observe(const Trial& trial, const Scope& scope,
                           const std::shared_ptr<Arena>& arena, const Listener& listener) const {
  const mpm::Scene& scene = trial.scene;
  mpm::Simulation simulation(scene, arena, simulation_options());
  std::optional<Filmer> filmer;
  if (!trial.view_times.empty()) {
    filmer.emplace(scene, filmed(trial, scope, listener.query), arena, options_.target);
  }
  Observation observation;
  std::vector<std::vector<Points>> seen(trial.watchers.size());
  std::vector<std::vector<Points>> speeds(trial.watchers.size());
  const auto record = [&] {
    const mpm::ObservedFrame frame =
        simulation.observe(filmer.has_value() || options_.loss != Loss::kChamfer);
    if (filmer) filmer->record(frame);
    for (std::size_t c = 0; c < seen.size(); ++c) {
      Points at = trial.watchers[c].positions(scene, frame, *arena);
      if (!trial.shift.isZero(0.0)) {
        for (Vec3d& x : at) x -= trial.shift;
      }
      seen[c].push_back(std::move(at));
      if (scope.velocities) speeds[c].push_back(trial.watchers[c].velocities(frame, *arena));
    }
  };
  record();
  for (int k = 0; k < trial.frames; ++k) {
    interrupter_.check();
    mpm::FrameReport report = simulation.advance(interrupter_);
    observation.substeps.push_back(report.substeps);
    observation.renewals.push_back(std::move(report.renewals));
    record();
    listener.tick();
  }
  for (std::size_t c = 0; c < seen.size(); ++c) {
    const std::size_t points = trial.watchers[c].size();
    SimulatedCapture capture = at_times(seen[c], points, trial.times[c], scene.fps);
    if (scope.velocities) {
      capture.velocities = at_times(speeds[c], points, trial.times[c], scene.fps).positions;
    }
    observation.captures.push_back(std::move(capture));
  }
  if (filmer) filmer->finish();
  return observation;
}

Filmer::Given Model::filmed(const Trial& trial, const Scope& scope, std::size_t query) const {
  const Filming& filming = *scope.filming;
  Filmer::Given given;
  given.views = filming.views;
  for (std::size_t v = 0; v < given.views.size(); ++v) {
    View& view = given.views[v];
    view.camera = posed(view.camera, trial.films[view.film].poses[view.number]);
    view.time = trial.view_times[v];
  }
  given.colours = filming.colours;
  given.shift = trial.shift;
  given.own = trial.own;
  given.see = [this, &filming, query](std::size_t v, const Drawn& drawn) {
    interrupter_.check();
    filming.see(query, v, drawn);
  };
  return given;
}

std::optional<Observation> Model::simulate(std::size_t run, const Query& query, const Scope& scope,
                                           const std::shared_ptr<Arena>& arena,
                                           const Listener& listener, Failure& failure) const {
  try {
    Trial trial = this->trial(run, query, scope, *arena);
    for (int attempt = 0;; ++attempt) {
      trial.set_substeps(std::ldexp(trial.finer, attempt));
      try {
        return observe(trial, scope, arena, listener);
      } catch (const Error& error) {
        const bool again = error.kind() == ErrorKind::kCompute && trial.steps != nullptr;
        if (!again || attempt == kMoreTries) throw;
      }
    }
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    failure = {error.what(), error.kind() == ErrorKind::kInput};
    return std::nullopt;
  }
}

mpm::Simulation::Options Model::simulation_options() const {
  mpm::Simulation::Options options;
  options.target = options_.target;
  options.memory_limit = static_cast<std::size_t>(1e9 * options_.memory_limit_gb);
  return options;
}

Evaluation Model::evaluate(const std::vector<std::vector<double>>& points, const Scope& scope,
                           const std::function<void(double)>& progress) const {
  std::vector<Query> queries;
  queries.reserve(points.size());
  for (const std::vector<double>& values : points) queries.push_back({values});
  return evaluate(queries, scope, progress);
}

Evaluation Model::evaluate(const std::vector<Query>& queries, const Scope& scope,
                           const std::function<void(double)>& progress) const {
  std::vector<std::size_t> runs;
  for (std::size_t r = 0; r < models_.size(); ++r) {
    if (scope.until[r] >= 0.0) runs.push_back(r);
  }
  const std::size_t tasks = queries.size() * runs.size();
  std::vector<std::optional<Observation>> results(tasks);
  std::vector<Failure> failures(tasks);
  double frames = 0.0;
  for (const std::size_t r : runs) frames += scope.until[r] * models_[r]->scene.fps;
  const double all = std::max(1.0, frames * double(queries.size()));
  std::atomic<std::size_t> done{0};
  const auto tick = [&] {
    const std::size_t count = ++done;
    if (progress) progress(std::min(1.0, double(count) / all));
  };
  // One thread a simulation; those that are left over help where there are few.
  double bytes = std::max(1.0, double(bytes_));
  if (scope.filming != nullptr) {
    const RunModel& of = *models_[scope.filming->run];
    std::size_t splats = 0;
    for (const OwnSplats& one : of.own) splats += one.splats.size();
    bytes += Filmer::bytes(of.scene, scope.filming->views, splats);
  }
  const double room = 1e9 * options_.memory_limit_gb / bytes;
  side_by_side(tasks, static_cast<std::size_t>(std::clamp(room, 1.0, 1e6)), options_.threads,
               [&](std::size_t i, const std::shared_ptr<Arena>& arena) {
                 const std::size_t query = i / runs.size();
                 results[i] = simulate(runs[i % runs.size()], queries[query], scope, arena,
                                       {tick, query}, failures[i]);
               });
  interrupter_.check();

  Evaluation evaluation;
  evaluation.outcomes.resize(queries.size());
  for (std::size_t p = 0; p < queries.size(); ++p) {
    Outcome outcome(models_.size());
    bool complete = true;
    for (std::size_t k = 0; k < runs.size() && complete; ++k) {
      const std::size_t i = p * runs.size() + k;
      complete = results[i].has_value();
      if (complete) {
        outcome[runs[k]] = std::move(*results[i]);
      } else {
        evaluation.failure = std::move(failures[i]);
      }
    }
    if (complete) evaluation.outcomes[p] = std::move(outcome);
  }
  return evaluation;
}

}  // namespace matterfit::fit
