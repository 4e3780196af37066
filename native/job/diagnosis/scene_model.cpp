// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/scene_model.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <thread>

#include "base/error.hpp"
#include "base/side_by_side.hpp"
#include "fit/data/capture_noise.hpp"
#include "fit/data/follow.hpp"
#include "fit/model/step_plan.hpp"
#include "job/diagnosis/hidden_collider.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_start.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/scene_at_level.hpp"
#include "mpm/simulation.hpp"
#include "mpm/step_limit.hpp"

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
/// Of the solver's margin (dt_safety), that a point beside the fitted values
/// may use.
constexpr double kNoiseMargin = 1.1;

std::string key_of(const diagnose::Numerics& n, std::size_t run) {
  std::string key = fmt::format("{} {:a} {:a} {:a} {:a} {:a} {}", run, n.spacing, n.offset.x(),
                                n.offset.y(), n.offset.z(), n.particles, n.seed);
  for (const double slope : n.lumping_slope) key += fmt::format(" {:a}", slope);
  for (const double bend : n.lumping_bend) key += fmt::format(" {:a}", bend);
  return key;
}

bool is_lumped(const diagnose::Numerics& n) {
  return !n.lumping_slope.isZero(0.0) || n.lumping_bend != decltype(n.lumping_bend){};
}

/// Numerics::lumping_slope and lumping_bend.
void lump(const diagnose::Numerics& n, mpm::Body& body) {
  if (!is_lumped(n)) return;
  Eigen::AlignedBox3d box;
  for (const Vec3d& x : body.rest) box.extend(x);
  const Vec3d half = (0.5 * box.sizes()).cwiseMax(1e-12);
  double before = 0.0;
  double after = 0.0;
  for (std::size_t i = 0; i < body.rest.size(); ++i) {
    const Vec3d x = (body.rest[i] - box.center()).cwiseQuotient(half);
    const Vec3d bend = (1.5 * x.cwiseProduct(x)).array() - 0.5;
    const Vec3d twist(x.x() * x.y(), x.y() * x.z(), x.z() * x.x());
    const double factor = 1.0 + n.lumping_slope.dot(x) +
                          Eigen::Map<const Vec3d>(n.lumping_bend.data()).dot(bend) +
                          Eigen::Map<const Vec3d>(n.lumping_bend.data() + 3).dot(twist);
    before += body.volumes[i];
    body.volumes[i] *= std::clamp(factor, 0.5, 2.0);
    after += body.volumes[i];
  }
  for (auto& volume : body.volumes) volume *= before / after;
}

/// Whether the fitted values' substeps serve: what lumping alone changes is then no other step.
bool has_own_steps(const diagnose::Numerics& n) {
  return n.spacing == 1.0 && n.step == 1.0 && n.offset.isZero(0.0) && n.particles == 1.0 &&
         n.seed == 0;
}

/// The parameters with the document's values as their starts: those are the
/// fitted ones.
std::vector<fit::ParameterSpec> at_document(std::vector<fit::ParameterSpec> specs) {
  for (fit::ParameterSpec& spec : specs) spec.start.clear();
  return specs;
}

/// Which coordinates of a capture were measured: one that never changes was
/// not.
std::array<bool, 3> measured_axes(const capture::Tracks& tracks) {
  std::array<bool, 3> axes{false, false, false};
  for (int a = 0; a < 3; ++a) {
    std::optional<double> first;
    for (const Vec3d& x : tracks.positions) {
      if (!std::isfinite(x[a])) continue;
      if (!first) first = x[a];
      axes[static_cast<std::size_t>(a)] |= x[a] != *first;
    }
  }
  return axes;
}

}  // namespace

/// A run's scene at some numerics, with what looks at its captures.
struct SceneModel::Built {
  mpm::Scene scene;
  std::vector<std::size_t> bodies;  ///< of each capture
  std::vector<fit::PointFollower> followers;
};

SceneModel::SceneModel(const Job& job, From from, const RunOptions& options,
                       const Interrupter& interrupter, std::vector<std::string>& statements)
    : job_(job), options_(options), interrupter_(interrupter) {
  if (options_.threads < 1) {
    options_.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  }
  loaded_ = load_experiment(job, statements);
  std::vector<mpm::Scene> scenes;
  for (std::size_t r = 0; r < runs().size(); ++r) {
    scenes.push_back(built({}, r)->scene);
    fit::settle_noise(loaded_.experiment.runs[r].captures, scenes.back(), statements);
  }
  const bool fitted = from == From::kDocument;
  parameters_ = std::make_unique<fit::Parameters>(
      fitted ? at_document(job.fit->parameters) : job.fit->parameters, runs(), scenes);
  listed_ = parameters_->parameters();
  fitted_count_ = listed_.size();
  if (!fitted) {
    const std::vector<double> starts =
        with_initial_motion(runs(), scenes, *parameters_, parameters_->starts()).guesses;
    for (std::size_t k = 0; k < listed_.size(); ++k) {
      listed_[k].start = std::clamp(starts[k], listed_[k].low, listed_[k].high);
    }
  }
  list_captures();
  fix_substeps();
  CauseOptions about;
  for (const fit::Parameter& parameter : parameters()) about.fitted.push_back(parameter.name);
  for (const diagnose::Capture& capture : captures_) {
    about.duration = std::max(about.duration, capture.times.back() - capture.times.front());
  }
  if (fitted) about.encounters = encounters_with(scenes.front().gravity);
  causes_ = scene_causes(loaded_.sources.front().job, scenes.front(), about);
  for (const Cause& cause : causes_) rows_.push_back(cause.row);
  if (fitted) add_nuisances();
}

SceneModel::~SceneModel() = default;

std::shared_ptr<const SceneModel::Built> SceneModel::built(const diagnose::Numerics& numerics,
                                                           std::size_t run) const {
  const std::string key = key_of(numerics, run);
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = built_.find(key); found != built_.end()) return found->second;
  }
  Arena arena(1);
  auto made = std::make_shared<Built>();
  Job job = loaded_.sources[run].job;
  for (BodyDoc& body : job.scene.bodies) {
    body.seed += static_cast<std::uint64_t>(numerics.seed);
  }
  // Particles per cell by their number: the grid follows the separation.
  made->scene = scene_at_level(job, numerics.spacing, arena, interrupter_);
  made->scene.grid_shift += numerics.offset;
  for (mpm::Body& body : made->scene.bodies) lump(numerics, body);
  for (const fit::Capture& capture : runs()[run].captures) {
    const std::size_t body = fit::body_index(made->scene, capture.input.body);
    made->bodies.push_back(body);
    made->followers.emplace_back(made->scene.bodies[body], capture.input.rest, 0.5 * made->scene.dx,
                                 arena);
  }
  const std::lock_guard lock(mutex_);
  return built_.emplace(key, std::move(made)).first->second;
}

void SceneModel::add_nuisances() {
  std::vector<ContactRun> contacts;
  std::vector<std::shared_ptr<const Built>> kept;
  std::vector<std::string> grounds;
  std::size_t c = 0;
  for (std::size_t r = 0; r < runs().size(); ++r) {
    kept.push_back(built({}, r));
    ContactRun& run = contacts.emplace_back();
    run.scene = &kept.back()->scene;
    run.bodies = kept.back()->bodies;
    for (std::size_t k = 0; k < run.bodies.size(); ++k) run.captures.push_back(&captures_[c++]);
    for (const ColliderDoc& doc : loaded_.sources[r].job.scene.colliders) {
      const bool known = std::ranges::count(grounds, doc.name) > 0;
      if (doc.shape == ColliderDoc::Shape::kGround && !known) grounds.push_back(doc.name);
    }
  }
  std::vector<std::string> fitted;
  for (const fit::Parameter& parameter : listed_) fitted.push_back(parameter.name);
  nuisances_ = ContactNuisances(contacts, grounds, fitted);
  std::ranges::copy(nuisances_.parameters(), std::back_inserter(listed_));
}

std::vector<Eigen::Index> SceneModel::corrections() const {
  std::vector<Eigen::Index> result;
  for (std::size_t k = fitted_count_ + nuisances_.of_grounds(); k < listed_.size(); ++k) {
    result.push_back(static_cast<Eigen::Index>(k));
  }
  return result;
}

std::vector<double> SceneModel::fitted_values(const diagnose::Point& point) const {
  std::vector<double> values;
  values.reserve(fitted_count_);
  for (std::size_t k = 0; k < fitted_count_; ++k) {
    values.push_back(
        fit::value_within_bounds(listed_[k], point.theta[static_cast<Eigen::Index>(k)]));
  }
  return values;
}

std::vector<double> SceneModel::nuisance_values(const diagnose::Point& point) const {
  // A point that encounters are looked for with has none.
  std::vector<double> values(point.theta.data() + fitted_count_,
                             point.theta.data() + point.theta.size());
  values.resize(nuisances_.parameters().size(), 0.0);
  return values;
}

/// What the recordings show at the fitted values, in the scene as it is.
std::vector<Encounter> SceneModel::encounters_with(const shape::Keyed<Vec3d>& gravity) const {
  diagnose::Point point;
  point.theta.resize(static_cast<Eigen::Index>(listed_.size()));
  for (std::size_t k = 0; k < listed_.size(); ++k) {
    point.theta[static_cast<Eigen::Index>(k)] =
        fit::to_natural(listed_[k].coordinate, listed_[k].start);
  }
  const auto motions = simulate_afresh({point});
  if (!motions.front()) return {};
  return encounters(captures_, motions.front()->positions, gravity.at(0.0));
}

void SceneModel::list_captures() {
  for (const fit::Run& run : runs()) {
    for (const fit::Capture& capture : run.captures) {
      const capture::Tracks& tracks = capture.input.tracks;
      diagnose::Capture row;
      inputs_.push_back(&capture.input);
      row.name = capture.input.name;
      row.times = tracks.times;
      row.rest = capture.input.rest;
      for (Vec3d& x : row.rest) {
        if (!x.allFinite()) x.setZero();
      }
      const std::size_t samples = tracks.frames() * tracks.points;
      row.positions = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * samples));
      row.use.assign(samples, diagnose::Use::kIgnored);
      row.axes = measured_axes(tracks);
      double noise = 0.0;
      for (const double sigma : capture.sigma) noise += sigma / double(capture.sigma.size());
      row.noise = noise;
      const mpm::Scene& scene = built({}, static_cast<std::size_t>(&run - runs().data()))->scene;
      const double end = (scene.end_frame - 1 - scene.first_frame) / scene.fps;
      for (std::size_t t = 0; t < tracks.frames(); ++t) {
        row.frames.push_back(scene.first_frame +
                             static_cast<int>(std::lround(tracks.times[t] * scene.fps)));
        row.at_rest.push_back(capture.input.release && tracks.times[t] < *capture.input.release);
        const bool simulated = tracks.times[t] >= -1e-9 && tracks.times[t] <= end + 1e-9;
        for (std::size_t i = 0; i < tracks.points; ++i) {
          const std::size_t s = t * tracks.points + i;
          if (!simulated || !tracks.is_visible(t, i) || !capture.input.rest[i].allFinite())
            continue;
          const bool used = capture.used[s] != 0;
          if (!used && capture.predicted[s] == 0) continue;
          row.use[s] = used ? diagnose::Use::kUsed : diagnose::Use::kHeldOut;
          row.positions.segment<3>(static_cast<Eigen::Index>(3 * s)) = tracks.positions[s];
        }
      }
      captures_.push_back(std::move(row));
    }
  }
}

void SceneModel::fix_substeps() {
  std::vector<double> values;
  values.reserve(listed_.size());
  for (const fit::Parameter& parameter : listed_) values.push_back(parameter.start);
  const auto arena = std::make_shared<Arena>(options_.threads);
  for (std::size_t r = 0; r < runs().size(); ++r) {
    mpm::Scene scene = built({}, r)->scene;
    parameters_->apply(values, r, scene);
    limits_.push_back(mpm::step_limit(scene));
    mpm::Simulation::Options solver;
    solver.target = options_.target;
    const int last = scene.end_frame;
    mpm::Simulation simulation(std::move(scene), arena, solver);
    std::vector<int> substeps;
    while (simulation.frame() + 1 < last) {
      interrupter_.check();
      substeps.push_back(simulation.advance(interrupter_).substeps);
    }
    substeps_.push_back(fit::with_neighbours(substeps));
  }
}

std::vector<int> SceneModel::own_capture() const {
  std::vector<int> owners(parameters().size(), -1);
  for (std::size_t k = 0; k < fitted_count_; ++k) {
    const fit::Address& path = parameters_->path(k);
    const bool of_capture = path.quantity->owner == fit::Owner::kCapture;
    const std::string& name = of_capture ? path.owner : path.capture;
    if (name.empty()) continue;
    for (std::size_t c = 0; c < captures_.size(); ++c) {
      if (captures_[c].name == name) owners[k] = static_cast<int>(c);
    }
  }
  return owners;
}

std::optional<std::vector<fit::SimulatedCapture>> SceneModel::simulate_run(
    const diagnose::Point& point, std::size_t run, const std::shared_ptr<Arena>& arena) const {
  const std::shared_ptr<const Built> base = built(point.numerics, run);
  mpm::Scene scene = base->scene;
  const std::vector<double> values = fitted_values(point);
  parameters_->apply(values, run, scene);
  const std::vector<double> nuisances = nuisance_values(point);
  nuisances_.set_grounds(nuisances, scene);
  nuisances_.add_impacts(nuisances, run, scene);
  for (const diagnose::Point::Cause& cause : point.causes) {
    const auto& apply = causes_[static_cast<std::size_t>(cause.effect)].apply;
    if (!apply) continue;
    apply({cause.values.data(), static_cast<std::size_t>(cause.values.size())}, cause.variant,
          scene);
  }
  if (!has_own_steps(point.numerics)) {
    scene.dt_safety *= point.numerics.step;
    return observe_run(scene, *base, values, run, arena);
  }
  const double ratio = limits_[run] / mpm::step_limit(scene) / kNoiseMargin;
  if (ratio > kMostFiner) return std::nullopt;
  const double finer =
      std::pow(kFiner, std::max(0.0, std::ceil(std::log(ratio) / std::log(kFiner))));
  for (int attempt = 0; attempt <= kMoreTries; ++attempt) {
    scene.substeps = fit::multiplied(substeps_[run], std::ldexp(finer, attempt));
    if (auto seen = observe_run(scene, *base, values, run, arena)) return seen;
  }
  return std::nullopt;
}

std::optional<std::vector<fit::SimulatedCapture>> SceneModel::observe_run(
    const mpm::Scene& scene, const Built& base, const std::vector<double>& values, std::size_t run,
    const std::shared_ptr<Arena>& arena) const {
  try {
    mpm::Simulation::Options solver;
    solver.target = options_.target;
    mpm::Simulation simulation(scene, arena, solver);
    // Points of a body that is placed anew: those that the document gives on it move along, those
    // that the recording shows stay where they were seen.
    std::vector<fit::PointFollower> moved;
    if (std::any_of(scene.bodies.begin(), scene.bodies.end(),
                    [&](const mpm::Body& b) { return parameters_->places(run, b.name); })) {
      for (std::size_t c = 0; c < base.followers.size(); ++c) {
        const fit::Capture& capture = runs()[run].captures[c];
        Points rest = capture.input.rest;
        if (capture.places_given) {
          mpm::Body points;
          points.name = capture.input.body;
          points.rest = std::move(rest);
          rest = parameters_->placed(values, run, std::move(points)).rest;
        }
        moved.emplace_back(scene.bodies[base.bodies[c]], std::move(rest), 0.5 * scene.dx, *arena);
      }
    }
    const std::vector<fit::PointFollower>& followers = moved.empty() ? base.followers : moved;
    std::vector<std::vector<Points>> seen(followers.size());
    const auto record = [&] {
      const mpm::ObservedFrame frame = simulation.observe(true);
      for (std::size_t c = 0; c < seen.size(); ++c) {
        const std::size_t body = base.bodies[c];
        seen[c].push_back(followers[c].positions(scene.bodies[body], frame.bodies[body], *arena));
      }
    };
    record();
    while (simulation.frame() + 1 < scene.end_frame) {
      interrupter_.check();
      (void)simulation.advance(interrupter_);
      record();
    }
    std::vector<fit::SimulatedCapture> captures;
    const double end = (scene.end_frame - 1 - scene.first_frame) / scene.fps;
    for (std::size_t c = 0; c < seen.size(); ++c) {
      const fit::Capture& capture = runs()[run].captures[c];
      std::vector<double> times = capture.input.tracks.times;
      const fit::Viewing viewing = parameters_->viewing(values, run, c);
      const double delay = (viewing.start_frame - capture.viewing.start_frame) / scene.fps;
      for (double& time : times) {
        const bool inside = time >= 0.0 && time <= end + 1e-9;
        time += delay;
        if (inside) time = std::clamp(time, 0.0, end);
      }
      captures.push_back(fit::at_times(seen[c], base.followers[c].size(), times, scene.fps));
    }
    return captures;
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    return std::nullopt;
  }
}

std::vector<std::optional<diagnose::Motion>> SceneModel::simulate(
    const std::vector<diagnose::Point>& points) const {
  if (!store_) return simulate_afresh(points);
  std::vector<std::optional<diagnose::Motion>> motions(points.size());
  std::vector<diagnose::Point> missing;
  std::vector<std::size_t> places;
  for (std::size_t p = 0; p < points.size(); ++p) {
    motions[p] = store_->find(points[p]);
    if (motions[p]) continue;
    missing.push_back(points[p]);
    places.push_back(p);
  }
  // As many at a time as run side by side: what is done is kept before the next begin.
  const auto batch = static_cast<std::size_t>(options_.threads);
  for (std::size_t first = 0; first < missing.size(); first += batch) {
    const std::size_t last = std::min(first + batch, missing.size());
    const std::vector<diagnose::Point> some(missing.begin() + static_cast<std::ptrdiff_t>(first),
                                            missing.begin() + static_cast<std::ptrdiff_t>(last));
    auto fresh = simulate_afresh(some);
    for (std::size_t k = 0; k < fresh.size(); ++k) {
      if (fresh[k]) store_->keep(some[k], *fresh[k]);
      motions[places[first + k]] = std::move(fresh[k]);
    }
  }
  return motions;
}

std::vector<std::optional<diagnose::Motion>> SceneModel::simulate_afresh(
    const std::vector<diagnose::Point>& points) const {
  const std::size_t tasks = points.size() * runs().size();
  std::vector<std::optional<std::vector<fit::SimulatedCapture>>> results(tasks);
  side_by_side(tasks, tasks, options_.threads,
               [&](std::size_t i, const std::shared_ptr<Arena>& arena) {
                 results[i] = simulate_run(points[i / runs().size()], i % runs().size(), arena);
               });
  Eigen::Index rows = 0;
  for (const diagnose::Capture& capture : captures_) rows += 3 * capture.samples();
  std::vector<std::optional<diagnose::Motion>> motions(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    diagnose::Motion motion;
    motion.positions = Eigen::VectorXd::Zero(rows);
    Eigen::Index at = 0;
    bool complete = true;
    for (std::size_t r = 0; r < runs().size() && complete; ++r) {
      const auto& seen = results[p * runs().size() + r];
      complete = seen.has_value();
      if (!complete) break;
      for (const fit::SimulatedCapture& capture : *seen) {
        for (const Vec3d& x : capture.positions) {
          if (x.allFinite()) motion.positions.segment<3>(at) = x;
          at += 3;
        }
      }
    }
    if (complete) motions[p] = std::move(motion);
  }
  return motions;
}

void SceneModel::write_nuisances(const diagnose::Point& point, Json& document,
                                 std::vector<std::string>& statements) const {
  if (nuisances_.parameters().empty()) return;
  const std::vector<double> values = nuisance_values(point);
  mpm::Scene scene = built({}, 0)->scene;
  parameters_->apply(fitted_values(point), 0, scene);
  nuisances_.set_grounds(values, scene);
  nuisances_.write_grounds(scene, document.at("scene"));
  statements.push_back(nuisances_.left_out(values));
}

}  // namespace matterfit::job
