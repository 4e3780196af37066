// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/error.hpp"
#include "base/side_by_side.hpp"
#include "fit/model/variation.hpp"
#include "job/diagnosis/scene_model.hpp"
#include "mpm/simulation.hpp"
#include "mpm/step_limit.hpp"

/// SceneModel's simulations.
namespace matterfit::job {
namespace {

/// Steps in which substeps are made more: a quarter of an octave.
constexpr double kFiner = 1.189207115002721;
/// Beyond so many times the substeps of the fitted values a point counts as one that cannot be
/// simulated: a hundred times the stiffness. A search that goes there follows what it cannot
/// explain.
constexpr double kMostFiner = 10.0;
/// With so many times twice the substeps a point is tried again that failed.
constexpr int kMoreTries = 2;
/// The share of the solver's margin (dt_safety) that a point beside the fitted values may use.
constexpr double kNoiseMargin = 1.1;

/// Cost of a particle's substep where its body damps or relaxes, and with a correction beside its
/// law, which is not compiled for registers: jelly_throw takes ten times as long with one.
constexpr double kOfDamping = 2.0;
constexpr double kOfCorrection = 10.0;

/// Whether the fitted values' substeps serve: what lumping alone changes is then no other step.
bool has_own_steps(const diagnose::Numerics& n) {
  return n.spacing == 1.0 && n.step == 1.0 && n.offset.isZero(0.0) && n.particles == 1.0 &&
         n.seed == 0 && n.contact_stiffness == 1.0 && n.contact_damping == 0.0 && n.loss == 0.0;
}

}  // namespace

mpm::Scene SceneModel::scene_at(const diagnose::Point& point, const Built& base,
                                const std::vector<double>& values, std::size_t run) const {
  mpm::Scene scene = base.scene;
  parameters_->apply(values, run, scene);
  nuisances_.set_grounds(nuisance_values(point), scene);
  for (const diagnose::Point::Cause& cause : point.causes) {
    const Cause& known = causes_[static_cast<std::size_t>(cause.effect)];
    if (!known.apply || known.run.value_or(run) != run) continue;
    known.apply({cause.values.data(), static_cast<std::size_t>(cause.values.size())}, cause.variant,
                scene);
  }
  return scene;
}

fit::RunSteps SceneModel::solvers_steps(const mpm::Scene& scene, const Watch& watch) const {
  fit::RunSteps steps;
  steps.limit = mpm::step_limit(scene);
  (void)watched(scene, watch, &steps.substeps);
  steps.substeps = fit::with_neighbours(steps.substeps);
  return steps;
}

std::vector<SceneModel::Target> SceneModel::targets_of(const diagnose::Point& point,
                                                       std::size_t run) const {
  std::vector<Target> targets;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const Target& known = nodes_[k];
    const ShootingNode& node = known.node;
    if (node.run != run) continue;
    std::array<double, kNumbersOfState> errors{};
    for (std::size_t i = 0; i < kNumbersOfState; ++i) {
      const auto at = static_cast<Eigen::Index>(first_of_states() + kNumbersOfState * k + i);
      if (at < point.theta.size()) errors[i] = point.theta[at];
    }
    const int capture = static_cast<int>(node.capture - captures_.data());
    std::vector<diagnose::Observed> observations;
    for (const diagnose::Point::Cause& cause : point.causes) {
      const diagnose::Effect& effect = rows_[static_cast<std::size_t>(cause.effect)];
      if (effect.observation != diagnose::Observation::kNone &&
          diagnose::acts_in(effect, capture)) {
        observations.push_back({&effect, cause.values});
      }
    }
    if (observations.empty()) {
      targets.push_back({node, with_errors(known.state, errors)});
      continue;
    }
    const mpm::Scene& scene = built({}, run)->scene;
    const double time = (node.frame - scene.first_frame) / scene.fps;
    if (auto state = flight_state(node, inertias_[run], time, observations)) {
      targets.push_back({node, with_errors(std::move(*state), errors)});
    }
  }
  return targets;
}

void SceneModel::take_up(const Watch& watch, const mpm::Scene& scene, const Seen& seen,
                         const mpm::ObservedFrame& frame, mpm::Simulation& simulation) const {
  for (const auto& [node, state] : watch.targets) {
    if (node.frame != simulation.frame()) continue;
    const auto capture =
        static_cast<std::size_t>(node.capture - captures_.data()) - first_capture(watch.run);
    simulation.change(node.body,
                      change_to(state, node, inertias_[watch.run], seen[capture].back(),
                                scene.bodies[node.body].volumes, frame.bodies[node.body]));
  }
}

std::optional<SceneModel::Seen> SceneModel::watch_in_steps(mpm::Scene scene,
                                                           const fit::RunSteps& steps,
                                                           const Watch& watch,
                                                           std::vector<int>& substeps) const {
  const double ratio = steps.limit / mpm::step_limit(scene) / kNoiseMargin;
  if (ratio > kMostFiner) return std::nullopt;
  const double finer =
      std::pow(kFiner, std::max(0.0, std::ceil(std::log(ratio) / std::log(kFiner))));
  for (int attempt = 0; attempt <= kMoreTries; ++attempt) {
    scene.substeps = fit::multiplied(steps.substeps, std::ldexp(finer, attempt));
    if (auto seen = watched_if_possible(scene, watch, substeps)) return seen;
  }
  return std::nullopt;
}

double SceneModel::work_of(const mpm::Scene& scene, const std::vector<int>& substeps) {
  double particles = 0.0;
  for (const mpm::Body& body : scene.bodies) {
    const material::Material& m = body.material;
    const bool damped = m.damping_shear > 0.0 || m.damping_bulk > 0.0 || !m.maxwell.empty();
    const double dear = !m.correction.empty() ? kOfCorrection : damped ? kOfDamping : 1.0;
    particles += dear * static_cast<double>(body.rest.size());
  }
  return particles * std::accumulate(substeps.begin(), substeps.end(), 0.0);
}

std::optional<SceneModel::SimulatedRun> SceneModel::simulate_run(
    const diagnose::Point& point, std::size_t run, const std::shared_ptr<Arena>& arena) const {
  for (const diagnose::Point::Cause& cause : point.causes) {
    const auto& allowed = causes_[static_cast<std::size_t>(cause.effect)].allowed;
    if (allowed && !allowed({cause.values.data(), static_cast<std::size_t>(cause.values.size())})) {
      return std::nullopt;
    }
  }
  const std::shared_ptr<const Built> base = built(point.numerics, run);
  const std::vector<double> values = fitted_values(point);
  mpm::Scene scene = scene_at(point, *base, values, run);
  if (!nuisances_.impacts().empty()) struck_by_another_solver(point.numerics, scene);
  nuisances_.add_impacts(nuisance_values(point), run, scene);
  scene.end_frame = end_frame(point, values, run);
  const Vec3d shift = fit::world_shift(scene.grid_shift, scene);
  if (!shift.isZero(0.0)) fit::move_world(shift, scene);
  const Watch watch{*base, values, run, arena, targets_of(point, run), shift};
  std::optional<Seen> seen;
  std::vector<int> substeps;
  if (has_own_steps(point.numerics)) {
    seen = watch_in_steps(scene, steps_[run], watch, substeps);
  } else {
    scene.dt_safety *= point.numerics.step;
    seen = watched_if_possible(scene, watch, substeps);
  }
  if (!seen) return std::nullopt;
  SimulatedRun result;
  result.work = work_of(scene, substeps);
  const double end = (scene.end_frame - 1 - scene.first_frame) / scene.fps;
  for (std::size_t c = 0; c < seen->size(); ++c) {
    const fit::Capture& capture = runs()[run].captures[c];
    std::vector<double> times = capture.input.tracks.times;
    const fit::Viewing viewing = parameters_->viewing(values, run, c);
    const double delay = (viewing.start_frame - capture.viewing.start_frame) / scene.fps;
    for (double& time : times) {
      const bool inside = time >= 0.0 && time <= end + 1e-9;
      time += delay;
      if (inside) time = std::clamp(time, 0.0, end);
    }
    result.captures.push_back(
        fit::at_times((*seen)[c], base->followers[c].size(), times, scene.fps));
  }
  return result;
}

int SceneModel::end_frame(const diagnose::Point& point, const std::vector<double>& values,
                          std::size_t run) const {
  // Interpolation between frames looks at one more on either side.
  constexpr int kMoreFrames = 3;
  const mpm::Scene& scene = built(point.numerics, run)->scene;
  if (point.until.empty()) return scene.end_frame;
  const std::size_t first = first_capture(run);
  int end = scene.first_frame + 1;
  for (std::size_t c = 0; c < runs()[run].captures.size(); ++c) {
    const double until = point.until[first + c];
    if (until < captures_[first + c].times.front()) continue;
    const double delay = parameters_->viewing(values, run, c).start_frame -
                         runs()[run].captures[c].viewing.start_frame;
    const double last = scene.first_frame + until * scene.fps + delay;
    end = std::max(end, static_cast<int>(std::ceil(std::min(last, 1e9))) + kMoreFrames);
  }
  return std::min(end, scene.end_frame);
}

SceneModel::Seen SceneModel::watched(const mpm::Scene& scene, const Watch& watch,
                                     std::vector<int>* substeps) const {
  const Built& base = watch.base;
  Arena& arena = *watch.arena;
  mpm::Simulation::Options solver;
  solver.target = options_.target;
  mpm::Simulation simulation(scene, watch.arena, solver);
  // Points of a body that is placed anew: those that the document gives on it move along, those
  // that the recording shows stay where they were seen.
  std::vector<fit::PointFollower> moved;
  if (std::any_of(scene.bodies.begin(), scene.bodies.end(),
                  [&](const mpm::Body& b) { return parameters_->places(watch.run, b.name); })) {
    for (std::size_t c = 0; c < base.followers.size(); ++c) {
      const fit::Capture& capture = runs()[watch.run].captures[c];
      Points rest = capture.input.rest;
      if (capture.places_given) {
        mpm::Body points;
        points.name = capture.input.body;
        points.rest = std::move(rest);
        rest = parameters_->placed(watch.values, watch.run, std::move(points)).rest;
      }
      for (Vec3d& x : rest) x += watch.shift;
      moved.emplace_back(scene.bodies[base.bodies[c]], capture.input, std::move(rest),
                         0.5 * scene.dx, arena);
    }
  }
  const std::vector<fit::PointFollower>& followers = moved.empty() ? base.followers : moved;
  Seen seen(followers.size());
  const auto record = [&] {
    const mpm::ObservedFrame frame = simulation.observe(true);
    for (std::size_t c = 0; c < seen.size(); ++c) {
      const std::size_t body = base.bodies[c];
      seen[c].push_back(followers[c].positions(scene.bodies[body], frame.bodies[body], arena));
      for (Vec3d& x : seen[c].back()) x -= watch.shift;
    }
    take_up(watch, scene, seen, frame, simulation);
  };
  record();
  while (simulation.frame() + 1 < scene.end_frame) {
    interrupter_.check();
    const mpm::FrameReport report = simulation.advance(interrupter_);
    if (substeps) substeps->push_back(report.substeps);
    record();
  }
  return seen;
}

std::optional<SceneModel::Seen> SceneModel::watched_if_possible(const mpm::Scene& scene,
                                                                const Watch& watch,
                                                                std::vector<int>& substeps) const {
  try {
    return watched(scene, watch, &substeps);
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    return std::nullopt;
  }
}

diagnose::Point SceneModel::as_looked_at(diagnose::Point point) const {
  if (point.until.empty()) return point;
  const std::vector<double> values = fitted_values(point);
  const auto forget = [&](std::size_t first, std::size_t count, std::size_t run, int frame) {
    const auto end = static_cast<Eigen::Index>(first + count);
    if (end > point.theta.size() || frame + 1 < end_frame(point, values, run)) return;
    point.theta.segment(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(count))
        .setZero();
  };
  std::size_t at = fitted_count_ + nuisances_.of_grounds();
  for (const Impact& impact : nuisances_.impacts()) {
    forget(at, ContactNuisances::kNumbersOfImpact, impact.run, impact.frame);
    at += ContactNuisances::kNumbersOfImpact;
  }
  for (const auto& [node, state] : nodes_) {
    forget(at, kNumbersOfState, node.run, node.frame);
    at += kNumbersOfState;
  }
  return point;
}

std::vector<std::optional<diagnose::Motion>> SceneModel::simulate(
    const std::vector<diagnose::Point>& asked) const {
  std::vector<diagnose::Point> points;
  points.reserve(asked.size());
  for (const diagnose::Point& point : asked) points.push_back(as_looked_at(point));
  std::vector<std::optional<diagnose::Motion>> motions(points.size());
  std::vector<std::size_t> missing;
  std::vector<std::pair<std::size_t, std::size_t>> twins;  // and of whom
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (store_) motions[p] = store_->find(points[p]);
    if (motions[p]) continue;
    const auto same = std::ranges::find_if(
        missing, [&](std::size_t other) { return points[other] == points[p]; });
    if (same == missing.end()) {
      missing.push_back(p);
    } else {
      twins.emplace_back(p, *same);
    }
  }
  struct Runs {
    std::vector<std::optional<SimulatedRun>> seen;
    std::atomic<std::size_t> left;
  };
  const std::size_t each = runs().size();
  std::vector<Runs> going(missing.size());
  for (Runs& of_point : going) {
    of_point.seen.resize(each);
    of_point.left = each;
  }
  const std::size_t tasks = missing.size() * each;
  side_by_side(tasks, tasks, options_.threads,
               [&](std::size_t i, const std::shared_ptr<Arena>& arena) {
                 const std::size_t p = missing[i / each];
                 Runs& of_point = going[i / each];
                 of_point.seen[i % each] = simulate_run(points[p], i % each, arena);
                 if (--of_point.left > 0) return;
                 motions[p] = motion_of(of_point.seen);
                 if (store_ && motions[p]) store_->keep(points[p], *motions[p]);
               });
  for (const auto& [twin, of] : twins) motions[twin] = motions[of];
  return motions;
}

std::optional<diagnose::Motion> SceneModel::motion_of(
    const std::vector<std::optional<SimulatedRun>>& seen) const {
  Eigen::Index rows = 0;
  for (const diagnose::Capture& capture : captures_) rows += 3 * capture.samples();
  diagnose::Motion motion;
  motion.positions = Eigen::VectorXd::Zero(rows);
  motion.work = 0.0;
  Eigen::Index at = 0;
  for (const std::optional<SimulatedRun>& run : seen) {
    if (!run) return std::nullopt;
    motion.work += run->work / std::max(1.0, work_);
    for (const fit::SimulatedCapture& capture : run->captures) {
      for (const Vec3d& x : capture.positions) {
        if (x.allFinite()) motion.positions.segment<3>(at) = x;
        at += 3;
      }
    }
  }
  return motion;
}

std::vector<std::optional<diagnose::Motion>> SceneModel::simulate_experiment(
    int experiment, const std::vector<diagnose::Point>& points) const {
  const auto e = static_cast<std::size_t>(experiment);
  const std::vector<double>& times = experiments_[e].layout.times;
  const std::shared_ptr<const Built> base = built({}, 0);
  const auto scene_of = [&](const diagnose::Point& point) {
    mpm::Scene scene = scene_at(point, *base, fitted_values(point), 0);
    remake(remakes_[e], base->bodies.front(), scene);
    return scene;
  };
  std::vector<std::optional<diagnose::Motion>> motions(points.size());
  fit::RunSteps steps;
  try {
    const diagnose::Point start = start_point();
    const std::vector<double> values = fitted_values(start);
    const auto arena = std::make_shared<Arena>(options_.threads);
    steps = solvers_steps(scene_of(start), {*base, values, 0, arena, {}});
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    return motions;
  }
  side_by_side(
      points.size(), points.size(), options_.threads,
      [&](std::size_t p, const std::shared_ptr<Arena>& arena) {
        const std::vector<double> values = fitted_values(points[p]);
        std::vector<int> substeps;
        const auto seen =
            watch_in_steps(scene_of(points[p]), steps, {*base, values, 0, arena, {}}, substeps);
        if (!seen) return;
        const fit::SimulatedCapture capture =
            fit::at_times(seen->front(), base->followers.front().size(), times, base->scene.fps);
        motions[p] = diagnose::Motion{};
        motions[p]->positions =
            Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * capture.positions.size()));
        for (std::size_t i = 0; i < capture.positions.size(); ++i) {
          if (!capture.positions[i].allFinite()) continue;
          motions[p]->positions.segment<3>(static_cast<Eigen::Index>(3 * i)) = capture.positions[i];
        }
      });
  return motions;
}

}  // namespace matterfit::job
