// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <new>

#include "base/error.hpp"
#include "fit/model/gradient_chain.hpp"
#include "fit/model/model_trial.hpp"
#include "material/neural/published_material.hpp"
#include "mpm/default_stiffness.hpp"
#include "mpm/gradient.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::fit {
namespace {

/// For the record of a gradient [bytes]. The same whatever the job may take, as its values must not
/// depend on that.
constexpr std::size_t kAdjointBudget = std::size_t{1} << 30U;

/// Adds what images say of one frame to what is said of its particles.
void add_drawn(const FilmBars& drawn, std::size_t frame, const mpm::Scene& scene,
               mpm::FrameLoss& loss) {
  for (std::size_t b = 0; b < drawn.bodies.size(); ++b) {
    const FilmBars::OfBody& from = drawn.bodies[b];
    const std::size_t particles = scene.bodies[b].rest.size();
    mpm::FrameLoss::Body& into = loss.bodies[b];
    if (frame < from.places.size() && !from.places[frame].empty()) {
      into.positions.resize(particles, Vec3d::Zero());
      for (std::size_t i = 0; i < particles; ++i) into.positions[i] += from.places[frame][i];
    }
    if (frame < from.columns.size() && !from.columns[frame].empty()) {
      into.deformation_gradients.resize(particles, Mat3d::Zero());
      for (std::size_t i = 0; i < particles; ++i) {
        for (int k = 0; k < 3; ++k) {
          into.deformation_gradients[i].col(k) += from.columns[frame][3 * i + std::size_t(k)];
        }
      }
    }
  }
}

}  // namespace

FilmBars Model::film_bars(const Trial& trial, const Scope& scope,
                          const std::shared_ptr<Arena>& arena) const {
  Filmer::Given given = filmed(trial, scope, 0);
  given.see = nullptr;
  given.bar = scope.filming->bar;
  given.frames = static_cast<std::size_t>(trial.frames) + 1;
  Filmer filmer(trial.scene, std::move(given), arena, options_.target);
  mpm::Simulation simulation(trial.scene, arena, simulation_options());
  filmer.record(simulation.observe(true));
  for (int k = 0; k < trial.frames; ++k) {
    interrupter_.check();
    (void)simulation.advance(interrupter_);
    filmer.record(simulation.observe(true));
  }
  filmer.finish();
  return filmer.bars();
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

double Model::gradient_cost() const {
  // One run with all threads and its way back, beside runs with one thread each; the way back of
  // updated bodies is longer.
  constexpr double kNodes = 4.0;  // of what keeps nodes alone
  constexpr double kUpdated = 7.0;
  double cost = kNodes;
  for (const auto& model : models_) {
    const auto& bodies = model->scene.bodies;
    if (std::any_of(bodies.begin(), bodies.end(), mpm::is_updated)) cost = kUpdated;
  }
  return cost;
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

void Model::add_through_cameras(std::size_t run, std::span<const double> values,
                                const Filming& filming, const FilmBars& drawn,
                                std::span<double> sum) const {
  constexpr double kDifference = 1e-5;  // of a length or an angle: where cubes of it are rounding
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    const Address& path = parameters_.path(i);
    if (!parameters_.acts_on(i, run) || !path.quantity->camera_slope) continue;
    const auto viewing = [&](double step, std::size_t film) {
      std::vector<double> moved(values.begin(), values.end());
      moved[i] += step;
      return parameters_.film_viewing(moved, run, film);
    };
    for (std::size_t v = 0; v < drawn.poses.size(); ++v) {
      const View& view = filming.views[v];
      if (runs_[run].films[view.film].name != path.owner || view.number != path.index) continue;
      const auto camera = [&](double step) {
        return posed(view.camera, viewing(step, view.film).poses[view.number]);
      };
      const splat::Camera at = camera(0.0);
      const splat::Camera more = camera(kDifference);
      const splat::Camera less = camera(-kDifference);
      const Mat3d spin =
          (more.rotation - less.rotation) * at.rotation.transpose() / (2.0 * kDifference);
      const Vec3d turn(spin(2, 1), spin(0, 2), spin(1, 0));
      const Vec3d shift =
          (more.translation - less.translation) / (2.0 * kDifference) - turn.cross(at.translation);
      const auto& pose = drawn.poses[v];
      for (std::size_t k = 0; k < 3; ++k) {
        sum[i] += pose[k] * turn[Eigen::Index(k)] + pose[3 + k] * shift[Eigen::Index(k)];
      }
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
  const bool found = each_gradient(values, scope, bars, weights, progress,
                                   [&](std::size_t run, const mpm::Scene& scene,
                                       const mpm::Gradient& gradient, const FilmBars& drawn) {
                                     add_slopes(parameters_, run, scene, gradient, sum);
                                     add_through_contacts(run, values, gradient, sum);
                                     if (scope.filming != nullptr) {
                                       add_through_cameras(run, values, *scope.filming, drawn, sum);
                                     }
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
      [&](std::size_t, const mpm::Scene& scene, const mpm::Gradient& gradient, const FilmBars&) {
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
      const FilmBars drawn = trial.view_times.empty() ? FilmBars() : film_bars(trial, scope, arena);
      std::vector<std::vector<Points>> frames;
      frames.reserve(trial.watchers.size());
      const bool seen = r < bars.size() && !bars[r].empty();
      for (std::size_t c = 0; c < (seen ? trial.watchers.size() : 0); ++c) {
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
        add_drawn(drawn, k, scene, loss);
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
      use(r, scene, gradient, drawn);
    }
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::kCancelled) throw;
    return false;
  } catch (const std::bad_alloc&) {
    return false;
  }
  return true;
}

}  // namespace matterfit::fit
