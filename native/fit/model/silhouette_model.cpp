// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/silhouette_model.hpp"

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

#include "base/error.hpp"
#include "base/side_by_side.hpp"
#include "capture/particle_gaussians.hpp"
#include "fit/data/follow.hpp"
#include "mpm/step_limit.hpp"

namespace matterfit::fit {
namespace {

constexpr double kSlack = 1e-6;  // frames

/// F of what flows is not how its particles moved.
bool carries_shape(const mpm::Body& body) { return !body.material.traits().fluid; }

/// The columns of F, one after the other, so that they are interpolated as points are.
Points columns(const std::vector<Mat3d>& gradients) {
  Points result;
  result.reserve(3 * gradients.size());
  for (const Mat3d& f : gradients) {
    for (int k = 0; k < 3; ++k) result.emplace_back(f.col(k));
  }
  return result;
}

}  // namespace

/// What the particles of each body do at the times that are drawn.
struct SilhouetteModel::Motion {
  struct OfBody {
    SimulatedCapture places;
    SimulatedCapture columns;  ///< of F; empty: not carried
  };
  std::vector<OfBody> bodies;
  std::vector<int> substeps;
};

SilhouetteModel::SilhouetteModel(mpm::Scene scene, const Parameters& parameters,
                                 const Options& options, const Interrupter& interrupter)
    : scene_(std::move(scene)),
      parameters_(parameters),
      options_(options),
      interrupter_(interrupter) {
  if (options_.threads < 1) {
    options_.threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  }
}

SilhouetteModel::Motion SilhouetteModel::simulate(const std::vector<double>& values, double until,
                                                  const std::vector<double>& times,
                                                  const std::shared_ptr<Arena>& arena) const {
  mpm::Scene scene = scene_;
  parameters_.apply(values, 0, scene);
  if (plan_.holds(0)) {
    scene.substeps = multiplied(plan_.runs[0].substeps, plan_.factor(0, scene));
  }
  mpm::Simulation::Options options;
  options.target = options_.target;
  options.memory_limit = static_cast<std::size_t>(1e9 * options_.memory_limit_gb);
  mpm::Simulation simulation(scene, arena, options);
  const int last = scene.end_frame - 1 - scene.first_frame;
  const int frames = std::clamp(static_cast<int>(std::ceil(until * scene.fps - kSlack)), 0, last);
  const std::size_t count = scene.bodies.size();
  std::vector<std::vector<Points>> places(count);
  std::vector<std::vector<Points>> shapes(count);
  const auto record = [&] {
    const mpm::ObservedFrame frame = simulation.observe(true);
    for (std::size_t b = 0; b < count; ++b) {
      places[b].push_back(frame.bodies[b].positions);
      if (carries_shape(scene.bodies[b])) {
        shapes[b].push_back(columns(frame.bodies[b].deformation_gradients));
      }
    }
  };
  Motion motion;
  record();
  for (int k = 0; k < frames; ++k) {
    interrupter_.check();
    motion.substeps.push_back(simulation.advance(interrupter_).substeps);
    record();
  }
  motion.bodies.resize(count);
  for (std::size_t b = 0; b < count; ++b) {
    const std::size_t particles = scene.bodies[b].rest.size();
    motion.bodies[b].places = at_times(places[b], particles, times, scene.fps);
    if (!shapes[b].empty()) {
      motion.bodies[b].columns = at_times(shapes[b], 3 * particles, times, scene.fps);
    }
  }
  return motion;
}

void SilhouetteModel::settle_steps(const std::vector<double>& values, double until) {
  plan_ = {};
  if (scene_.dt > 0.0) return;
  const auto arena = std::make_shared<Arena>(options_.threads);
  Motion motion = simulate(values, until, {}, arena);
  if (motion.substeps.empty()) return;
  mpm::Scene scene = scene_;
  parameters_.apply(values, 0, scene);
  std::vector<RunSteps> runs(1);
  runs[0] = {with_neighbours(motion.substeps), mpm::step_limit(scene)};
  plan_ = StepPlan(std::move(runs));
}

void SilhouetteModel::draw_one(const std::vector<double>& values,
                               const std::vector<SilhouetteView>& views, const Sink& sink,
                               const std::shared_ptr<Arena>& arena) const {
  std::vector<double> times;
  times.reserve(views.size());
  double until = 0.0;
  for (const SilhouetteView& view : views) {
    if (times.empty() || view.time != times.back()) times.push_back(view.time);
    until = std::max(until, view.time);
  }
  const Motion motion = simulate(values, until, times, arena);
  const double separation = 0.5 * scene_.dx;
  splat::Rasteriser rasteriser(arena, options_.target);
  std::size_t t = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const SilhouetteView& view = views[v];
    while (times[t] != view.time) ++t;
    std::vector<Vec3f> positions;
    std::vector<Mat3f> gradients;
    for (std::size_t b = 0; b < motion.bodies.size(); ++b) {
      if (view.body && *view.body != b) continue;
      const Motion::OfBody& body = motion.bodies[b];
      const std::size_t particles = scene_.bodies[b].rest.size();
      for (std::size_t i = 0; i < particles; ++i) {
        positions.push_back(body.places.positions[t * particles + i].cast<float>());
        Mat3f f = Mat3f::Identity();
        if (!body.columns.positions.empty()) {
          for (int k = 0; k < 3; ++k) {
            f.col(k) =
                body.columns.positions[3 * (t * particles + i) + std::size_t(k)].cast<float>();
          }
        }
        gradients.push_back(f);
      }
    }
    const bool inside = std::all_of(positions.begin(), positions.end(),
                                    [](const Vec3f& x) { return x.allFinite(); });
    if (!inside) continue;  // outside of the simulated time
    const splat::Gaussians gaussians =
        capture::particle_gaussians(positions, gradients, view.size * separation);
    sink(v, rasteriser.render(gaussians, view.camera).mask);
  }
}

std::vector<std::string> SilhouetteModel::draw(const std::vector<std::vector<double>>& points,
                                               const std::vector<SilhouetteView>& views,
                                               const std::vector<Sink>& sinks) const {
  std::vector<std::string> failures(points.size());
  side_by_side(points.size(), points.size(), options_.threads,
               [&](std::size_t p, const std::shared_ptr<Arena>& arena) {
                 try {
                   draw_one(points[p], views, sinks[p], arena);
                 } catch (const Error& error) {
                   if (error.kind() == ErrorKind::kCancelled) throw;
                   failures[p] = error.what();
                 }
               });
  interrupter_.check();
  return failures;
}

}  // namespace matterfit::fit
