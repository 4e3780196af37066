// SPDX-License-Identifier: GPL-3.0-or-later
// The adjoint of total Lagrangian substeps against central differences in double: each law, with
// and without damping and relaxation, free, pinned and with an attached mass.
#include "mpm/total_adjoint.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>

namespace matterfit::mpm {
namespace {

constexpr double kH = 0.025;
constexpr double kTotalDt = 2e-4;
constexpr int kSteps = 24;
constexpr int kObserved[] = {11, 23};
constexpr double kSmoothing = 0.05;
/// Gradients (by the logarithm of what is positive) are of this size.
constexpr double kScale = 0.1;

enum class Held { kFree, kPlane, kBox, kMoved, kMass };

/// A bar of 2 × 2 × 3 cells on a lattice that is turned against the world.
Scene bar_scene(const material::Material& material, Held held) {
  Scene scene;
  scene.fps = 100.0;
  scene.first_frame = 0;
  scene.end_frame = 2;
  scene.dx = 2.0 * kH;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(1.0, -2.0, -9.0));
  Body body;
  body.name = "bar";
  body.density = 900.0;
  body.formulation = Formulation::kTotal;
  body.material = material;
  body.lattice.regular = true;
  body.lattice.spacing = kH;
  body.lattice.axes = Quatd(Eigen::AngleAxisd(0.4, Vec3d(1, 2, -1).normalized()));
  body.lattice.origin = Vec3d(0.3, 0.1, 0.2);
  body.velocity = Vec3d(0.3, -0.2, 0.5);
  body.spin = Vec3d(2.0, -3.0, 4.0);
  std::mt19937 random(19);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const Mat3d axes = body.lattice.axes.toRotationMatrix();
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 6; ++k) {
        const Vec3d x = kH * Vec3d(i + 0.5, j + 0.5, k + 0.5);
        body.rest.push_back(axes * x + body.lattice.origin);
        body.volumes.push_back(kH * kH * kH);
        body.particle_velocities.push_back(
            Vec3d(uniform(random), uniform(random), uniform(random)) +
            8.0 * Vec3d(x.z() - 0.05, 0.5 * x.x(), -x.y()));
      }
  Pin pin;
  const Vec3d corner = body.lattice.origin;
  switch (held) {
    case Held::kFree:
      break;
    case Held::kPlane:
    case Held::kMass:
      pin.region = Pin::Region::kPlane;
      pin.point = corner;
      pin.normal = axes.col(2);
      body.pins.push_back(pin);
      break;
    case Held::kBox:
    case Held::kMoved:
      pin.region = Pin::Region::kSphere;
      pin.point = corner + axes * Vec3d(0.05, 0.05, 0.0);
      pin.radius = 0.045;
      if (held == Held::kMoved) {
        pin.motion.times = {0.0, 0.01};
        pin.motion.values = {shape::Pose{},
                             shape::Pose{Vec3d(0.002, 0.001, -0.003), Quatd::Identity()}};
      }
      body.pins.push_back(pin);
      break;
  }
  if (held == Held::kMass) {
    body.masses.push_back({corner + axes * Vec3d(0.07, 0.04, 0.16), 0.2, 0.0});
    body.masses.push_back({corner + axes * Vec3d(0.02, 0.05, 0.14), 0.1, 0.001});
  }
  scene.bodies.push_back(body);
  return scene;
}

/// The bar's roll-out in substeps of its own, and a number that depends on all of it.
struct Rollout {
  Scene scene;
  std::vector<Vec3d> weights;  ///< of each particle's position

  explicit Rollout(Scene s) : scene(std::move(s)) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    for (std::size_t p = 0; p < scene.bodies[0].rest.size(); ++p) {
      weights.emplace_back(uniform(random), uniform(random), uniform(random));
    }
  }

  [[nodiscard]] static double smoothing(int step) { return step % 8 == 7 ? kSmoothing : 0.0; }
  [[nodiscard]] static double kick(int step) { return step == 0 ? 0.5 * kTotalDt : kTotalDt; }

  template <class S>
  double run(std::vector<TotalState<S>>* record) const {
    Arena arena(1);
    TotalBody<S> body(scene.bodies[0], scene, kernels<S>(SimdTarget::kAuto));
    double loss = 0.0;
    for (int n = 0; n < kSteps; ++n) {
      if (record != nullptr) record->push_back(body.record());
      body.compute_forces(arena, kTotalDt, true);
      body.step_nodes(arena, kick(n), kTotalDt, scene.gravity.at(0.0), n * kTotalDt);
      if (smoothing(n) > 0.0) body.smooth_velocities(arena, smoothing(n));
      if (n != kObserved[0] && n != kObserved[1]) continue;
      for (std::uint32_t p = 0; p < weights.size(); ++p) {
        loss += 1e3 * weights[p].dot(body.state(body.point(p)).position);
      }
    }
    return loss;
  }

  struct Gradient {
    InitialCotangents initial;
    material::MaterialGradient material;
    Vec3d gravity = Vec3d::Zero();
    double log_density = 0.0;
  };

  template <class S>
  Gradient gradient(int threads = 1) const {
    std::vector<TotalState<S>> record;
    (void)run<S>(&record);
    Arena arena(threads);
    TotalBody<S> body(scene.bodies[0], scene, kernels<S>(SimdTarget::kAuto));
    TotalAdjoint<S> adjoint(body, scene.bodies[0].material, adjoint_kernels<S>(SimdTarget::kAuto));
    TotalCotangents<S> bar = adjoint.zero();
    for (int n = kSteps - 1; n >= 0; --n) {
      if (n == kObserved[0] || n == kObserved[1]) {
        std::vector<Vec3d> position_bar;
        for (const Vec3d& weight : weights) position_bar.emplace_back(1e3 * weight);
        adjoint.add_particles(arena, position_bar, {}, {}, bar);
      }
      adjoint.substep(arena, {n * kTotalDt, kTotalDt, kick(n), smoothing(n), scene.gravity.at(0.0)},
                      record[static_cast<std::size_t>(n)], bar);
    }
    return {adjoint.initial(bar), adjoint.material_gradient(bar), bar.gravity, bar.log_density};
  }

  /// Fourth-order central difference when `move(scene, step)` changes the scene.
  [[nodiscard]] double difference(double step,
                                  const std::function<void(Scene&, double)>& move) const {
    const auto value = [&](double by) {
      Rollout moved = *this;
      move(moved.scene, by);
      return moved.run<double>(nullptr);
    };
    return (8.0 * (value(step) - value(-step)) - (value(2.0 * step) - value(-2.0 * step))) /
           (12.0 * step);
  }

  /// `found` to 1e-6 of the difference's size, or of `scale` where that is larger. Where a particle
  /// begins to yield between the two sides the difference is none: then a smaller step counts.
  void expect(double found, double scale, const std::string& what, double step,
              const std::function<void(Scene&, double)>& move, double factor = 1.0) const {
    double expected = 0.0;
    for (int k = 0; k < 6; ++k) {
      expected = factor * difference(step, move);
      if (std::abs(expected - found) <= 1e-6 * std::max(std::abs(expected), scale)) return;
      step *= 0.3;
    }
    ADD_FAILURE() << what << ": difference " << expected << ", adjoint " << found;
  }
};

struct Case {
  std::string name;
  material::Material material;
  Held held;
};

std::vector<Case> cases() {
  using material::Law;
  std::vector<Case> all;
  material::Material m;
  m.youngs_modulus = 3e5;
  m.poisson_ratio = 0.3;
  const auto add = [&](const char* name, Law law, Held held) {
    m.law = law;
    all.push_back({name, m, held});
  };
  add("corotated", Law::kFixedCorotated, Held::kFree);
  add("neo-Hookean", Law::kNeoHookean, Held::kFree);
  add("Hencky", Law::kStvkHencky, Held::kFree);
  add("neo-Hookean, plane", Law::kNeoHookean, Held::kPlane);
  add("neo-Hookean, box", Law::kNeoHookean, Held::kBox);
  add("neo-Hookean, moved box", Law::kNeoHookean, Held::kMoved);
  add("neo-Hookean, masses", Law::kNeoHookean, Held::kMass);
  m.poisson_ratio = 0.47;
  add("split neo-Hookean, plane", Law::kNeoHookean, Held::kPlane);
  m.poisson_ratio = 0.3;
  m.damping_shear = 20.0;
  m.damping_bulk = 10.0;
  add("damped", Law::kNeoHookean, Held::kPlane);
  add("damped Hencky", Law::kStvkHencky, Held::kFree);
  m.maxwell = {{5e4, 1e-3}, {8e4, 0.02}};
  add("relaxing", Law::kNeoHookean, Held::kMass);
  m.damping_shear = m.damping_bulk = 0.0;
  m.yield_stress = 500.0;
  m.hardening = 1e4;
  add("von Mises", Law::kVonMises, Held::kPlane);
  m.hardening = 0.0;
  m.viscosity = 30.0;
  add("Herschel-Bulkley", Law::kHerschelBulkley, Held::kFree);
  m.maxwell.clear();
  m.friction_angle = 30.0;
  m.cohesion = 2e3;
  add("Drucker-Prager", Law::kDruckerPrager, Held::kPlane);
  return all;
}

TEST(TotalAdjoint, MatchesDifferencesForEveryLawAndHold) {
  for (const Case& item : cases()) {
    const Rollout rollout(bar_scene(item.material, item.held));
    const auto g = rollout.gradient<double>();
    const material::Material& m = item.material;
    const auto of = [&](const char* name, double gradient, double value,
                        double material::Material::*member) {
      rollout.expect(
          value * gradient, kScale, item.name + " " + name, 1e-4 * value,
          [&](Scene& scene, double by) { scene.bodies[0].material.*member += by; }, value);
    };
    using material::Material;
    of("E", g.material.youngs_modulus, m.youngs_modulus, &Material::youngs_modulus);
    of("nu", g.material.poisson_ratio, m.poisson_ratio, &Material::poisson_ratio);
    if (m.damping_shear > 0.0) {
      of("damping", g.material.damping_shear, m.damping_shear, &Material::damping_shear);
      of("bulk damping", g.material.damping_bulk, m.damping_bulk, &Material::damping_bulk);
    }
    if (m.law == material::Law::kVonMises) {
      of("hardening", g.material.hardening, m.hardening, &Material::hardening);
    }
    if (m.law == material::Law::kVonMises || m.law == material::Law::kHerschelBulkley) {
      of("yield", g.material.yield_stress, m.yield_stress, &Material::yield_stress);
    }
    if (m.law == material::Law::kHerschelBulkley) {
      of("viscosity", g.material.viscosity, m.viscosity, &Material::viscosity);
    }
    if (m.law == material::Law::kDruckerPrager) {
      of("friction angle", g.material.friction_angle, m.friction_angle, &Material::friction_angle);
      of("cohesion", g.material.cohesion, m.cohesion, &Material::cohesion);
    }
    for (std::size_t b = 0; b < m.maxwell.size(); ++b) {
      const double modulus = m.maxwell[b].modulus;
      rollout.expect(
          modulus * g.material.maxwell[b].modulus, kScale, item.name + " modulus", 1e-3 * modulus,
          [&](Scene& scene, double by) { scene.bodies[0].material.maxwell[b].modulus += by; },
          modulus);
      const double time = m.maxwell[b].time;
      rollout.expect(
          time * g.material.maxwell[b].time, kScale, item.name + " time", 1e-3 * time,
          [&](Scene& scene, double by) { scene.bodies[0].material.maxwell[b].time += by; }, time);
    }
    for (int axis = 0; axis < 3; ++axis) {
      rollout.expect(g.initial.velocity[axis], kScale, item.name + " velocity", 1e-3,
                     [&](Scene& scene, double by) { scene.bodies[0].velocity[axis] += by; });
      rollout.expect(g.initial.spin[axis], kScale, item.name + " spin", 1e-2,
                     [&](Scene& scene, double by) { scene.bodies[0].spin[axis] += by; });
      rollout.expect(g.gravity[axis], 0.1 * kScale, item.name + " gravity", 1e-2,
                     [&](Scene& scene, double by) { scene.gravity.values[0][axis] += by; });
    }
    const double density = rollout.scene.bodies[0].density;
    rollout.expect(
        g.log_density, kScale, item.name + " density", 1e-3 * density,
        [&](Scene& scene, double by) { scene.bodies[0].density += by; }, density);
    // All particle velocities at once, along a direction.
    double along = 0.0;
    std::vector<Vec3d> direction;
    std::mt19937 random(8);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    for (const Vec3d& v : g.initial.particle_velocities) {
      direction.emplace_back(uniform(random), uniform(random), uniform(random));
      along += direction.back().dot(v);
    }
    rollout.expect(along, kScale, item.name + " particle velocities", 1e-3,
                   [&](Scene& scene, double by) {
                     for (std::size_t p = 0; p < direction.size(); ++p) {
                       scene.bodies[0].particle_velocities[p] += by * direction[p];
                     }
                   });
  }
}

TEST(TotalAdjoint, FloatsAgreeWithDoubleAndThreadsDoNotMatter) {
  for (const Case& item : cases()) {
    const Rollout rollout(bar_scene(item.material, item.held));
    const auto exact = rollout.gradient<double>();
    const auto one = rollout.gradient<float>(1);
    const auto two = rollout.gradient<float>(2);
    EXPECT_EQ(one.initial.velocity, two.initial.velocity) << item.name;
    EXPECT_EQ(one.material.youngs_modulus, two.material.youngs_modulus) << item.name;
    EXPECT_LT((one.initial.velocity - exact.initial.velocity).norm(),
              1e-3 * exact.initial.velocity.norm() + 1e-3)
        << item.name;
    EXPECT_LT(std::abs(one.material.youngs_modulus - exact.material.youngs_modulus) *
                  item.material.youngs_modulus,
              2e-3 * std::abs(exact.material.youngs_modulus) * item.material.youngs_modulus + 2e-3)
        << item.name;
  }
}

}  // namespace
}  // namespace matterfit::mpm
