// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/scene_model.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>
#include <thread>

#include "base/error.hpp"
#include "fit/data/capture_noise.hpp"
#include "fit/search/start.hpp"
#include "job/diagnosis/hidden_collider.hpp"
#include "job/documents/fit_document.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/scene_at_level.hpp"
#include "mpm/grid_alignment.hpp"

namespace matterfit::job {
namespace {

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

std::vector<Eigen::Index> numbers_between(std::size_t first, std::size_t end) {
  std::vector<Eigen::Index> result(end - first);
  std::iota(result.begin(), result.end(), static_cast<Eigen::Index>(first));
  return result;
}

}  // namespace

SceneModel::SceneModel(const Job& job, From from, const RunOptions& options,
                       const Interrupter& interrupter, std::vector<std::string>& statements,
                       bool shooting)
    : job_(job), shooting_(shooting), options_(options), interrupter_(interrupter) {
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
        fit::with_initial_motion(runs(), scenes, *parameters_, parameters_->starts()).guesses;
    for (std::size_t k = 0; k < listed_.size(); ++k) {
      listed_[k].start = std::clamp(starts[k], listed_[k].low, listed_[k].high);
    }
  }
  list_captures();
  settle_steps();
  list_experiments();
  CauseOptions about;
  about.fitted = fitted_numbers();
  about.duration = 0.0;
  about.rows = 0.0;
  for (const diagnose::Capture& capture : captures_) {
    const auto axes = std::ranges::count(capture.axes, true);
    about.rows += double(axes * std::ranges::count(capture.use, diagnose::Use::kUsed));
    about.duration = std::max(about.duration, capture.times.back() - capture.times.front());
  }
  for (std::size_t r = 1; r < runs().size(); ++r) {
    if (!runs()[r].own || !runs()[r].fitted) continue;
    const RunSource& source = loaded_.sources[r];
    const Json& body = source.job.document.at("scene").at("bodies").at(0);
    about.own_scenes.push_back({r, source.group.name, body.value("masses", Json::array())});
  }
  if (fitted) about.encounters = encounters_with(scenes.front().gravity);
  causes_ = scene_causes(loaded_.sources.front().job, scenes.front(), about);
  for (const Cause& cause : causes_) rows_.push_back(cause.row);
  if (fitted) add_nuisances();
  if (!nodes_.empty()) settle_steps();
}

SceneModel::~SceneModel() = default;

Vec3d SceneModel::free_offset(const Vec3d& offset, std::size_t run) const {
  Vec3d result = offset;
  if (offset.isZero(0.0)) return result;
  const std::shared_ptr<const Built> own = built({}, run);
  for (const mpm::Body& body : own->scene.bodies) {
    const std::array<bool, 3> aligned = mpm::aligned_axes(body, own->scene.dx);
    for (int axis = 0; axis < 3; ++axis) {
      if (aligned[std::size_t(axis)]) result[axis] = 0.0;
    }
  }
  return result;
}

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
  made->scene.grid_shift += free_offset(numerics.offset, run);
  for (mpm::Body& body : made->scene.bodies) lump(numerics, body);
  for (const fit::Capture& capture : runs()[run].captures) {
    const std::size_t body = fit::body_index(made->scene, capture.input.body);
    made->bodies.push_back(body);
    made->followers.emplace_back(made->scene.bodies[body], capture.input, capture.input.rest,
                                 0.5 * made->scene.dx, arena);
  }
  const std::lock_guard lock(mutex_);
  return built_.emplace(key, std::move(made)).first->second;
}

std::vector<fit::Address> SceneModel::fitted_numbers() const {
  std::vector<fit::Address> numbers;
  numbers.reserve(fitted_count_);
  for (std::size_t k = 0; k < fitted_count_; ++k) numbers.push_back(parameters_->path(k));
  return numbers;
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
  nuisances_ = ContactNuisances(contacts, grounds, fitted_numbers());
  std::ranges::copy(nuisances_.parameters(), std::back_inserter(listed_));
  add_shooting_nodes();
  add_state_errors();
}

/// Nodes for a scene's only body: another would be struck otherwise. Not where the fit moves the
/// time at which the recording began.
void SceneModel::add_shooting_nodes() {
  const fit::Quantity& start_frame = fit::row_named(fit::Owner::kCapture, "start_frame");
  if (fit::is_among(start_frame, fitted_numbers()) || !shooting_) return;
  for (std::size_t r = 0; r < runs().size(); ++r) {
    const mpm::Scene& scene = built({}, r)->scene;
    inertias_.push_back(inertia_of(scene.bodies.front().rest, scene.bodies.front().volumes));
    if (scene.bodies.size() != 1) continue;
    std::vector<Impact> of_run;
    std::ranges::copy_if(nuisances_.impacts(), std::back_inserter(of_run),
                         [&](const Impact& impact) { return impact.run == r; });
    for (ShootingNode& node : shooting_nodes(of_run, scene)) {
      const double time = (node.frame - scene.first_frame) / scene.fps;
      if (auto state = flight_state(node, inertias_[r], time, {})) {
        nodes_.push_back({node, std::move(*state)});
      }
    }
  }
}

void SceneModel::add_state_errors() {
  // Differences by a hundredth of a deviation would drown in single precision.
  constexpr double kDeviations = 10.0;
  constexpr double kMostDeviations = 100.0;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const StateNoise& noise = nodes_[k].state.noise;
    const auto add = [&](const char* what, const char* unit, double sigma) {
      for (int axis = 0; axis < 3; ++axis) {
        listed_.push_back(nuisance(fmt::format("flight {} {}[{}]", k, what, axis), unit, sigma,
                                   kMostDeviations * sigma));
        listed_.back().scale = kDeviations * sigma;
      }
    };
    add("place", "m", noise.place);
    add("turn", "rad", noise.turn);
    add("velocity", "m/s", noise.velocity);
    add("spin", "rad/s", noise.spin);
  }
}

std::size_t SceneModel::first_capture(std::size_t run) const {
  std::size_t first = 0;
  for (std::size_t r = 0; r < run; ++r) first += runs()[r].captures.size();
  return first;
}

std::vector<Eigen::Index> SceneModel::corrections() const {
  return numbers_between(fitted_count_ + nuisances_.of_grounds(), first_of_states());
}

std::vector<Eigen::Index> SceneModel::state_errors() const {
  return numbers_between(first_of_states(), listed_.size());
}

std::vector<diagnose::ContactFrame> SceneModel::contact_frames() const {
  std::vector<diagnose::ContactFrame> result;
  for (const Impact& impact : nuisances_.impacts()) {
    const auto capture = static_cast<int>(impact.capture - captures_.data());
    for (Eigen::Index frame = impact.begin; frame < impact.end; ++frame) {
      result.push_back({capture, frame, impact.place, impact.angle});
    }
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

diagnose::Point SceneModel::start_point() const {
  diagnose::Point point;
  point.theta.resize(static_cast<Eigen::Index>(listed_.size()));
  for (std::size_t k = 0; k < listed_.size(); ++k) {
    point.theta[static_cast<Eigen::Index>(k)] =
        fit::to_natural(listed_[k].coordinate, listed_[k].start);
  }
  return point;
}

/// What the recordings show at the fitted values, in the scene as it is.
std::vector<Encounter> SceneModel::encounters_with(const shape::Keyed<Vec3d>& gravity) const {
  const auto motions = simulate({start_point()});
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

void SceneModel::settle_steps() {
  const diagnose::Point start = start_point();
  const std::vector<double> values = fitted_values(start);
  const auto arena = std::make_shared<Arena>(options_.threads);
  steps_.clear();
  work_ = 0.0;
  for (std::size_t r = 0; r < runs().size(); ++r) {
    const std::shared_ptr<const Built> base = built({}, r);
    const mpm::Scene scene = scene_at(start, *base, values, r);
    steps_.push_back(solvers_steps(scene, {*base, values, r, arena, targets_of(start, r)}));
    work_ += work_of(scene, steps_.back().substeps);
  }
}

void SceneModel::list_experiments() {
  std::vector<std::string> grounds;
  for (const ColliderDoc& doc : loaded_.sources.front().job.scene.colliders) {
    if (doc.shape == ColliderDoc::Shape::kGround) grounds.push_back(doc.name);
  }
  const std::shared_ptr<const Built> base = built({}, 0);
  mpm::Scene scene = base->scene;
  parameters_->apply(fitted_values(start_point()), 0, scene);
  for (const Remake& other : remakes_of(scene, base->bodies.front(), grounds)) {
    diagnose::Capture layout;
    const diagnose::Capture& present = captures_.front();
    layout.name = other.name;
    layout.rest = present.rest;
    layout.axes = present.axes;
    layout.noise = present.noise;
    layout.times = present.times;
    const double first = present.times.front();
    const double last = present.times.back();
    const double again =
        last - first + (last - first) / double(std::max<std::size_t>(1, present.times.size() - 1));
    for (const double time : present.times) {
      if (time + again - first <= other.duration * (last - first) + 1e-9)
        layout.times.push_back(time + again);
    }
    layout.use.assign(static_cast<std::size_t>(layout.samples()), diagnose::Use::kUsed);
    remakes_.push_back(other);
    experiments_.push_back({other.name, other.sentence, std::move(layout)});
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

void SceneModel::write_nuisances(const diagnose::Point& point, Json& document,
                                 std::vector<std::string>& statements) const {
  if (nuisances_.parameters().empty()) return;
  const std::vector<double> values = nuisance_values(point);
  mpm::Scene scene = built({}, 0)->scene;
  parameters_->apply(fitted_values(point), 0, scene);
  nuisances_.set_grounds(values, scene);
  nuisances_.write_grounds(scene, document.at("scene"));
  statements.push_back(nuisances_.left_out(values));
  if (nodes_.empty()) return;
  statements.push_back(fmt::format(
      "In {} flights between impacts the diagnosis put the body where the recording shows it, so "
      "that each impact is judged by itself; the extended model runs through.",
      nodes_.size()));
}

}  // namespace matterfit::job
