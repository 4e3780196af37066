// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_model.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <new>
#include <system_error>
#include <thread>

#include "base/error.hpp"
#include "fit/data/metrics.hpp"
#include "fit/data/surface_points.hpp"
#include "job/fit_gradient.hpp"
#include "mpm/default_stiffness.hpp"
#include "mpm/gradient.hpp"
#include "mpm/step_limit.hpp"

namespace matterfit::job {
namespace {

/// Of those that a loss between clouds looks at: more tell little more.
constexpr std::size_t kMostParticles = 8192;
/// Of the solver's margin (dt_safety), that values beside the ones whose substeps are taken may
/// use.
constexpr double kMargin = 1.1;
/// Steps in which substeps are made more or fewer: a quarter of an octave.
constexpr double kFiner = 1.189207115002721;
constexpr int kMoreTries = 2;
/// More than 32 times the substeps with which a stage began: such a step is refused, as it would
/// take as many times as long.
constexpr int kMostFiner = 20;
/// For the record of a gradient [bytes]. The same whatever the job may take, as its values must not
/// depend on that.
constexpr std::size_t kAdjointBudget = std::size_t{1} << 30U;
/// So many steps fewer are worth another sequence of substeps: half of them.
constexpr int kWorthCoarser = 4;

/// Where a capture's samples are: points bound to the body, or particles of it.
struct Watcher {
  std::size_t body = 0;
  std::optional<fit::PointFollower> points;
  std::vector<std::size_t> particles;

  [[nodiscard]] std::size_t size() const { return points ? points->size() : particles.size(); }
  [[nodiscard]] Points see(const mpm::Scene& scene, const mpm::FrameState& state,
                           Arena& arena) const {
    if (points) return points->positions(scene.bodies[body], state.bodies[body], arena);
    Points seen;
    seen.reserve(particles.size());
    for (const std::size_t p : particles) {
      seen.push_back(state.bodies[body].positions[p].cast<double>());
    }
    return seen;
  }
};

}  // namespace

struct FitModel::RunModel {
  mpm::Scene scene;
  std::vector<Watcher> watchers;  ///< one a capture, as the loss looks at it
  std::vector<Points> surfaces;   ///< one a capture, with the surface loss

  [[nodiscard]] static std::vector<std::size_t> drawn(std::size_t all) {
    return fit::draw(all, std::min(all, kMostParticles), 0);
  }
  /// `rest`: of the points that are looked at; of particles none.
  [[nodiscard]] static Watcher watch(const mpm::Scene& scene, const FitCapture& capture,
                                     FitDoc::Loss loss, Points rest, Arena& arena) {
    Watcher watcher;
    watcher.body = fit::body_index(scene, capture.input.body);
    const mpm::Body& body = scene.bodies[watcher.body];
    if (loss == FitDoc::Loss::kChamfer) {
      watcher.particles = drawn(body.rest.size());
    } else {
      watcher.points.emplace(body, std::move(rest), 0.5 * scene.dx, arena);
    }
    return watcher;
  }

  /// What the surface loss looks at, at rest.
  [[nodiscard]] static Points surface_of(const mpm::Body& body, Arena& arena) {
    if (body.material.traits().fluid) {
      throw_input("fit.loss: \"surface\" follows the surface that body '" + body.name +
                  "' has at rest, and a fluid makes new ones: take \"chamfer\".");
    }
    const Points all = fit::surface_points(body.rest, body.volumes, arena);
    if (all.empty()) {
      throw_input("fit.loss: the particles of body '" + body.name +
                  "' have no surface: take \"chamfer\".");
    }
    Points chosen;
    for (const std::size_t i : drawn(all.size())) chosen.push_back(all[i]);
    return chosen;
  }
};

FitModel::FitModel(const std::vector<FitRun>& runs, std::vector<mpm::Scene> scenes,
                   const FitParameters& parameters, const Options& options,
                   const Interrupter& interrupter)
    : runs_(runs), parameters_(parameters), options_(options), interrupter_(interrupter) {
  if (options_.threads < 1) {
    options_.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  }
  Arena arena(options_.threads);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    auto model = std::make_unique<RunModel>();
    model->scene = std::move(scenes[r]);
    for (const FitCapture& capture : runs[r].captures) {
      Points rest = capture.input.rest;
      if (options_.loss == FitDoc::Loss::kSurface) {
        const std::size_t body = fit::body_index(model->scene, capture.input.body);
        rest = RunModel::surface_of(model->scene.bodies[body], arena);
        model->surfaces.push_back(rest);
      }
      model->watchers.push_back(
          RunModel::watch(model->scene, capture, options_.loss, std::move(rest), arena));
    }
    bytes_ = std::max(bytes_, mpm::Simulation::estimate(model->scene).bytes);
    models_.push_back(std::move(model));
  }
  steps_.resize(runs.size());
  refinements_.assign(runs.size(), kUnsettled);
}

FitModel::~FitModel() = default;

const mpm::Scene& FitModel::scene(std::size_t run) const { return models_[run]->scene; }

std::vector<FitSteps> FitModel::steps_of(std::span<const double> values,
                                         const FitOutcome& outcome) const {
  std::vector<FitSteps> steps = steps_;
  for (std::size_t r = 0; r < models_.size(); ++r) {
    if (outcome[r].substeps.empty()) continue;
    mpm::Scene scene = models_[r]->scene;
    parameters_.apply(values, r, scene);
    steps[r] = {outcome[r].substeps, mpm::step_limit(scene)};
  }
  return steps;
}

namespace {

/// How often the substeps are multiplied by kFiner (negative: divided) for a limit of stability.
int steps_finer(const FitSteps& steps, double limit, double margin) {
  if (!(limit > 0.0) || !std::isfinite(limit)) return 0;
  return static_cast<int>(std::ceil(std::log(steps.limit / limit / margin) / std::log(kFiner)));
}

std::vector<int> multiplied(const std::vector<int>& substeps, double factor) {
  std::vector<int> result;
  result.reserve(substeps.size());
  for (const int count : substeps) {
    result.push_back(std::max(1, static_cast<int>(std::ceil(factor * count - 1e-9))));
  }
  return result;
}

}  // namespace

int FitModel::refined(std::size_t run, const mpm::Scene& scene) const {
  return std::max(refinements_[run], steps_finer(steps_[run], mpm::step_limit(scene), kMargin));
}

void FitModel::settle(std::span<const double> values, std::span<const int> before) {
  for (std::size_t r = 0; r < models_.size(); ++r) {
    if (steps_[r].substeps.empty()) continue;
    mpm::Scene scene = models_[r]->scene;
    parameters_.apply(values, r, scene);
    // The steps of the differences beside these values go without more substeps.
    const int asked = steps_finer(steps_[r], mpm::step_limit(scene), 0.95 * kMargin);
    const bool keep = !before.empty() && asked < before[r] && asked > before[r] - kWorthCoarser;
    refinements_[r] = keep ? before[r] : asked;
  }
}

/// What is simulated, and where and when it is looked at.
struct FitModel::Trial {
  Trial() = default;
  Trial(Trial&&) = default;  // a copy would look at what `moved` was copied from
  Trial& operator=(Trial&&) = default;
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;
  ~Trial() = default;

  mpm::Scene scene;
  std::vector<Watcher> moved;  ///< of bodies that are placed anew
  std::span<const Watcher> watchers;
  std::vector<std::vector<double>> times;  ///< of each capture
  int frames = 0;                          ///< after the first
  bool own_steps = false;                  ///< the solver chooses its substeps
  double finer = 1.0;                      ///< else the factor of those that were chosen
};

FitModel::Trial FitModel::trial(std::size_t run, std::span<const double> values, const Scope& scope,
                                Arena& arena) const {
  const RunModel& model = *models_[run];
  const FitRun& fit_run = runs_[run];
  Trial trial;
  trial.scene = model.scene;
  mpm::Scene& scene = trial.scene;
  parameters_.apply(values, run, scene);
  const FitDoc::Loss loss = options_.loss;
  trial.watchers = model.watchers;
  const bool placed = std::any_of(scene.bodies.begin(), scene.bodies.end(),
                                  [&](const auto& b) { return parameters_.places(run, b.name); });
  if (placed) {
    for (std::size_t c = 0; c < fit_run.captures.size(); ++c) {
      const FitCapture& capture = fit_run.captures[c];
      const bool surface = loss == FitDoc::Loss::kSurface;
      Points rest = surface ? model.surfaces[c] : capture.input.rest;
      if (surface || capture.places_given) {
        for (Vec3d& x : rest) x = parameters_.placed(values, run, capture.input.body, x);
      }
      trial.moved.push_back(RunModel::watch(scene, capture, loss, std::move(rest), arena));
    }
    trial.watchers = trial.moved;
  }
  const int last = scene.end_frame - 1 - scene.first_frame;
  const double end = last / scene.fps;
  double latest = 0.0;
  for (const FitCapture& capture : fit_run.captures) {
    const double delay = parameters_.delay(values, run, capture.input.name);
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
  const double until = scope.until[run] + latest;
  trial.frames = std::min(last, int(std::ceil(until * scene.fps - 1e-6)));
  trial.own_steps = scope.solver_steps || scene.dt > 0.0 || steps_[run].substeps.empty();
  if (trial.own_steps) return trial;
  const int finer = refined(run, scene);
  if (finer > kMostFiner) {
    throw_compute("the values ask for more than 32 times the substeps of where the search began.");
  }
  trial.finer = std::pow(kFiner, finer);
  return trial;
}

std::optional<FitObservation> FitModel::simulate(std::size_t run, std::span<const double> values,
                                                 const Scope& scope,
                                                 const std::shared_ptr<Arena>& arena,
                                                 const std::function<void()>& tick,
                                                 Failure& failure) const {
  try {
    Trial trial = this->trial(run, values, scope, *arena);
    mpm::Scene& scene = trial.scene;
    for (int attempt = 0;; ++attempt) {
      if (!trial.own_steps) {
        scene.substeps = multiplied(steps_[run].substeps, std::ldexp(trial.finer, attempt));
      }
      try {
        mpm::Simulation simulation(scene, arena, simulation_options());
        FitObservation observation;
        std::vector<std::vector<Points>> seen(trial.watchers.size());
        const auto record = [&] {
          const mpm::FrameState state = simulation.state();
          for (std::size_t c = 0; c < seen.size(); ++c) {
            seen[c].push_back(trial.watchers[c].see(scene, state, *arena));
          }
        };
        record();
        for (int k = 0; k < trial.frames; ++k) {
          interrupter_.check();
          observation.substeps.push_back(simulation.advance(interrupter_).substeps);
          record();
          tick();
        }
        for (std::size_t c = 0; c < seen.size(); ++c) {
          observation.captures.push_back(
              fit::at_times(seen[c], trial.watchers[c].size(), trial.times[c], scene.fps));
        }
        return observation;
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCompute || trial.own_steps || attempt == kMoreTries) throw;
      }
    }
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    failure = {error.what(), error.kind() == ErrorKind::kInput};
    return std::nullopt;
  }
}

mpm::Simulation::Options FitModel::simulation_options() const {
  mpm::Simulation::Options options;
  options.target = options_.target;
  options.memory_limit = static_cast<std::size_t>(1e9 * options_.memory_limit_gb);
  return options;
}

bool FitModel::has_gradient() const {
  if (options_.loss != FitDoc::Loss::kTracks) return false;
  for (std::size_t r = 0; r < models_.size(); ++r) {
    const mpm::Scene& scene = models_[r]->scene;
    if (!matterfit::job::has_gradient(parameters_, r, scene)) return false;
    if (mpm::follows_several_bodies(scene) && !parameters_.moved_materials(r).empty()) return false;
  }
  return true;
}

void FitModel::add_through_contacts(std::size_t run, std::span<const double> values,
                                    const mpm::Gradient& gradient, std::span<double> sum) const {
  constexpr double kDifference = 1e-4;
  // Of several bodies those that are fitted have no contact that follows: has_gradient().
  if (models_[run]->scene.bodies.size() > 1) return;
  const auto stiffnesses = [&](std::size_t i, double value) {
    std::vector<double> moved(values.begin(), values.end());
    moved[i] = value;
    mpm::Scene scene = models_[run]->scene;
    parameters_.apply(moved, run, scene);
    return mpm::contact_stiffnesses(scene, scene.bodies.front());
  };
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    if (!parameters_.acts_on(i, run) || !parameters_.path(i).is_material()) continue;
    const fit::Parameter& parameter = parameters_.parameters()[i];
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

std::optional<std::vector<double>> FitModel::pull_back(
    const std::vector<double>& values, const Scope& scope,
    const std::vector<std::vector<Points>>& bars,
    const std::function<void(double)>& progress) const {
  if (!has_gradient()) return std::nullopt;
  std::vector<double> sum(parameters_.size(), 0.0);
  const auto arena = std::make_shared<Arena>(options_.threads);
  try {
    for (std::size_t r = 0; r < models_.size(); ++r) {
      if (scope.until[r] < 0.0) continue;
      Trial trial = this->trial(r, values, scope, *arena);
      mpm::Scene& scene = trial.scene;
      if (!trial.own_steps) scene.substeps = multiplied(steps_[r].substeps, trial.finer);
      scene.end_frame = scene.first_frame + trial.frames + 1;
      std::vector<std::vector<Points>> frames;
      for (std::size_t c = 0; c < trial.watchers.size(); ++c) {
        frames.push_back(fit::frames_bar(static_cast<std::size_t>(trial.frames) + 1,
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
          mpm::FrameLoss::Body& of = loss.bodies[watcher.body];
          const std::size_t particles = scene.bodies[watcher.body].rest.size();
          of.positions.resize(particles, Vec3d::Zero());
          of.deformation_gradients.resize(particles, Mat3d::Zero());
          watcher.points->spread(bar, of.positions, of.deformation_gradients);
        }
      };
      mpm::GradientOptions options;
      options.simulation = simulation_options();
      options.memory_budget = kAdjointBudget;
      options.of_no_damping = false;
      options.deformation_gradients = true;
      options.progress = progress;
      const mpm::Gradient gradient =
          mpm::gradient<float>(scene, arena, observer, options, interrupter_);
      add_gradient(parameters_, r, scene, gradient, sum);
      add_through_contacts(r, values, gradient, sum);
    }
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    return std::nullopt;
  } catch (const std::bad_alloc&) {
    return std::nullopt;
  }
  return sum;
}

std::vector<std::optional<FitOutcome>> FitModel::evaluate(
    const std::vector<std::vector<double>>& points, const Scope& scope,
    const std::function<void(double)>& progress) const {
  std::vector<std::size_t> runs;
  for (std::size_t r = 0; r < models_.size(); ++r) {
    if (scope.until[r] >= 0.0) runs.push_back(r);
  }
  const std::size_t tasks = points.size() * runs.size();
  std::vector<std::optional<FitObservation>> results(tasks);
  std::vector<Failure> failures(tasks);
  double frames = 0.0;
  for (const std::size_t r : runs) frames += scope.until[r] * models_[r]->scene.fps;
  const double all = std::max(1.0, frames * double(points.size()));
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> done{0};
  std::atomic<bool> stop{false};
  std::exception_ptr thrown;
  std::mutex mutex;
  const auto tick = [&] {
    const std::size_t count = ++done;
    if (progress) progress(std::min(1.0, double(count) / all));
  };
  // One thread a simulation; those that are left over help where there are few.
  const double room = 1e9 * options_.memory_limit_gb / double(std::max<std::size_t>(1, bytes_));
  const auto workers = std::min({tasks, static_cast<std::size_t>(options_.threads),
                                 static_cast<std::size_t>(std::clamp(room, 1.0, 1e6))});
  const int each = tasks == 0 ? 1 : std::max(1, options_.threads / static_cast<int>(workers));
  const auto work = [&] {
    try {
      const auto arena = std::make_shared<Arena>(each);
      for (std::size_t i = next++; i < tasks && !stop; i = next++) {
        results[i] = simulate(runs[i % runs.size()], points[i / runs.size()], scope, arena, tick,
                              failures[i]);
      }
    } catch (...) {
      stop = true;
      const std::lock_guard lock(mutex);
      if (!thrown) thrown = std::current_exception();
    }
  };
  if (workers <= 1) {
    work();
  } else {
    std::vector<std::jthread> threads;
    threads.reserve(workers);
    try {
      for (std::size_t k = 0; k < workers; ++k) threads.emplace_back(work);
    } catch (const std::system_error&) {
      // Those that could be started do the work of the others.
      if (threads.empty()) work();
    }
  }
  if (thrown) std::rethrow_exception(thrown);
  interrupter_.check();

  std::vector<std::optional<FitOutcome>> outcomes(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    FitOutcome outcome(models_.size());
    bool complete = true;
    for (std::size_t k = 0; k < runs.size() && complete; ++k) {
      const std::size_t i = p * runs.size() + k;
      complete = results[i].has_value();
      if (complete) {
        outcome[runs[k]] = std::move(*results[i]);
      } else {
        failure_ = failures[i];
      }
    }
    if (complete) outcomes[p] = std::move(outcome);
  }
  return outcomes;
}

}  // namespace matterfit::job
