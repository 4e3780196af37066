// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/model.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <new>
#include <thread>

#include "base/error.hpp"
#include "base/side_by_side.hpp"
#include "fit/model/gradient_chain.hpp"
#include "fit/model/watcher.hpp"
#include "material/neural/published_material.hpp"
#include "mpm/default_stiffness.hpp"
#include "mpm/gradient.hpp"
#include "mpm/step_limit.hpp"

namespace matterfit::fit {
namespace {

constexpr int kMoreTries = 2;
/// For the record of a gradient [bytes]. The same whatever the job may take, as its values must not
/// depend on that.
constexpr std::size_t kAdjointBudget = std::size_t{1} << 30U;

}  // namespace

struct Model::RunModel {
  mpm::Scene scene;
  std::vector<Watcher> watchers;  ///< one a capture, as the loss looks at it
  std::vector<Points> watched;    ///< points of each, as the body was built
};

/// What is simulated, and where and when it is looked at.
struct Model::Trial {
  Trial() = default;
  Trial(Trial&&) = default;  // a copy would look at what `moved` was copied from
  Trial& operator=(Trial&&) = default;
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;
  ~Trial() = default;

  mpm::Scene scene;
  std::vector<Watcher> moved;  ///< of bodies that are placed anew
  std::span<const Watcher> watchers;
  Vec3d shift = Vec3d::Zero();             ///< of the whole scene, to be taken off [m]
  std::vector<std::vector<double>> times;  ///< of each capture
  std::vector<Viewing> films;              ///< of each of the run
  std::vector<double> view_times;          ///< of Filming::views; empty: none is drawn
  int frames = 0;                          ///< after the first
  const RunSteps* steps = nullptr;         ///< null: the solver chooses its substeps
  double finer = 1.0;                      ///< the factor of those that were chosen

  void set_substeps(double factor) {
    if (steps != nullptr) scene.substeps = multiplied(steps->substeps, factor);
  }
};

/// Who is told of one query's simulation.
struct Model::Listener {
  std::function<void()> tick;  ///< a frame is done
  std::size_t query = 0;
};

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
    bytes_ = std::max(bytes_, mpm::Simulation::estimate(model->scene).bytes);
    models_.push_back(std::move(model));
  }
}

Model::~Model() = default;

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
    runs[r] = {with_neighbours(outcome[r].substeps), mpm::step_limit(scene_at(values, r))};
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
    filmer.emplace(scene, filmed(trial, scope, listener), arena, options_.target);
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
    observation.substeps.push_back(simulation.advance(interrupter_).substeps);
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

Filmer::Given Model::filmed(const Trial& trial, const Scope& scope,
                            const Listener& listener) const {
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
  given.see = [this, &filming, query = listener.query](std::size_t v, const Drawn& drawn) {
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

bool Model::has_gradient() const {
  if (options_.loss != Loss::kTracks) return false;
  for (std::size_t r = 0; r < models_.size(); ++r) {
    const mpm::Scene& scene = models_[r]->scene;
    if (!has_slopes(parameters_, r, scene)) return false;
    if (mpm::follows_several_bodies(scene) && !parameters_.moved_materials(r).empty()) return false;
  }
  return true;
}

void Model::add_through_contacts(std::size_t run, std::span<const double> values,
                                 const mpm::Gradient& gradient, std::span<double> sum) const {
  constexpr double kDifference = 1e-4;
  // With several bodies, those that are fitted have no contact that follows: has_gradient().
  if (models_[run]->scene.bodies.size() > 1) return;
  const auto stiffnesses = [&](std::size_t i, double value) {
    std::vector<double> moved(values.begin(), values.end());
    moved[i] = value;
    const mpm::Scene scene = scene_at(moved, run);
    return mpm::contact_stiffnesses(scene, scene.bodies.front());
  };
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    if (!parameters_.acts_on(i, run) || !parameters_.path(i).quantity->is_material()) continue;
    const Parameter& parameter = parameters_.parameters()[i];
    const double high = std::min(parameter.high, values[i] * (1.0 + kDifference));
    const double low = std::max(parameter.low, values[i] * (1.0 - kDifference));
    const std::vector<double> more = stiffnesses(i, high);
    const std::vector<double> less = stiffnesses(i, low);
    for (std::size_t c = 0; c < more.size(); ++c) {
      if (more[c] == less[c]) continue;
      sum[i] += gradient.colliders[c].stiffness * (more[c] - less[c]) / (high - low);
    }
  }
}

std::optional<std::vector<double>> Model::pull_back(
    const std::vector<double>& values, const Scope& scope,
    const std::vector<std::vector<Points>>& bars,
    const std::function<void(double)>& progress) const {
  if (!has_gradient()) return std::nullopt;
  std::vector<double> sum(parameters_.size(), 0.0);
  const Quantity& move = row_named(Owner::kBody, "material.weight_moves[#]");
  bool weights = false;
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    weights = weights || parameters_.path(i).quantity == &move;
  }
  const bool found =
      each_gradient(values, scope, bars, weights, progress,
                    [&](std::size_t run, const mpm::Scene& scene, const mpm::Gradient& gradient) {
                      add_slopes(parameters_, run, scene, gradient, sum);
                      add_through_contacts(run, values, gradient, sum);
                    });
  if (!found) return std::nullopt;
  return sum;
}

std::optional<std::vector<double>> Model::pull_back_published(
    const std::vector<double>& values, const Scope& scope,
    const std::vector<std::vector<Points>>& bars, const std::string& body,
    const std::function<void(double)>& progress) const {
  std::vector<double> sum;
  const bool found = each_gradient(
      values, scope, bars, true, progress,
      [&](std::size_t, const mpm::Scene& scene, const mpm::Gradient& gradient) {
        const std::vector<double>& of = gradient.bodies[body_index(scene, body)].material.published;
        sum.resize(std::max(sum.size(), of.size()), 0.0);
        for (std::size_t i = 0; i < of.size(); ++i) sum[i] += of[i];
      });
  if (!found || sum.empty()) return std::nullopt;
  return sum;
}

bool Model::each_gradient(const std::vector<double>& values, const Scope& scope,
                          const std::vector<std::vector<Points>>& bars, bool published_weights,
                          const std::function<void(double)>& progress,
                          const UseGradient& use) const {
  const auto arena = std::make_shared<Arena>(options_.threads);
  try {
    for (std::size_t r = 0; r < models_.size(); ++r) {
      if (scope.until[r] < 0.0) continue;
      Trial trial = this->trial(r, {values}, scope, *arena);
      mpm::Scene& scene = trial.scene;
      trial.set_substeps(trial.finer);
      scene.end_frame = scene.first_frame + trial.frames + 1;
      std::vector<std::vector<Points>> frames;
      frames.reserve(trial.watchers.size());
      for (std::size_t c = 0; c < trial.watchers.size(); ++c) {
        frames.push_back(frames_bar(static_cast<std::size_t>(trial.frames) + 1,
                                    trial.watchers[c].size(), trial.times[c], scene.fps,
                                    bars[r][c]));
      }
      const mpm::Observer observer = [&](const mpm::ObservedFrame& frame, mpm::FrameLoss& loss) {
        const auto k = static_cast<std::size_t>(frame.frame - scene.first_frame);
        for (std::size_t c = 0; c < frames.size(); ++c) {
          const Watcher& watcher = trial.watchers[c];
          const Points& bar = frames[c][k];
          if (std::all_of(bar.begin(), bar.end(), [](const Vec3d& x) { return x.isZero(0.0); })) {
            continue;
          }
          mpm::FrameLoss::Body& of = loss.bodies[watcher.body()];
          const std::size_t particles = scene.bodies[watcher.body()].rest.size();
          of.positions.resize(particles, Vec3d::Zero());
          of.deformation_gradients.resize(particles, Mat3d::Zero());
          watcher.points().spread(bar, frame.bodies[watcher.body()], of.positions,
                                  of.deformation_gradients);
        }
      };
      mpm::GradientOptions options;
      options.simulation = simulation_options();
      options.memory_budget = kAdjointBudget;
      options.of_no_damping = false;
      options.published_weights = published_weights;
      options.deformation_gradients = true;
      options.progress = progress;
      const mpm::Gradient gradient =
          mpm::gradient<float>(scene, arena, observer, options, interrupter_);
      use(r, scene, gradient);
    }
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    return false;
  } catch (const std::bad_alloc&) {
    return false;
  }
  return true;
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
    bytes += Filmer::bytes(models_[scope.filming->run]->scene, scope.filming->views);
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
