// SPDX-License-Identifier: GPL-3.0-or-later
// A run of updated Lagrangian bodies in substeps of its own, a number that depends on all of it,
// and that number's gradient against differences.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "mpm/updated_adjoint.hpp"
#include "mpm/updated_group.hpp"

namespace matterfit::mpm {

/// Into the tests' XML: how near to the differences the gradients came.
inline void record_worst(const std::string& name, double worst) {
  std::ostringstream text;
  text << worst;
  testing::Test::RecordProperty(name, text.str());
}

/// How many acts of a kind a substep has on record.
template <class Act, class S>
[[nodiscard]] std::size_t count_acts(const UpdatedRecord<S>& record) {
  std::size_t sum = 0;
  for (const UpdatedActsPtr& acts : record.acts) {
    if (dynamic_cast<const UpdatedActsOf<Act>*>(acts.get()) == nullptr) continue;
    sum += UpdatedActsOf<Act>::of(*acts).size();
  }
  return sum;
}

struct UpdatedRollout {
  struct Gradient {
    std::vector<StartCotangents> start;
    std::vector<material::MaterialGradient> material;
    Vec3d gravity = Vec3d::Zero();
    std::vector<shape::ColliderCotangents> colliders;
  };

  Scene scene;
  int steps = 16;
  int second_frame = 9;  ///< substep that begins another frame
  double dt = 3e-4;
  double scale = 1e3;         ///< of the weights of positions
  double worst = 0.0;         ///< of all checks so far: relative error
  bool of_published = false;  ///< gradients by the published law's weights too

  explicit UpdatedRollout(Scene s) : scene(std::move(s)) {}

  /// Weight of each particle's position, velocity and deformation in the number.
  static Vec3d weight(std::size_t p) {
    const auto x = static_cast<double>(p);
    return {std::sin(1.0 + x), std::cos(2.0 * x), std::sin(3.0 + 0.7 * x)};
  }
  static Mat3d strain_weight(std::size_t p) {
    Mat3d m;
    for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = std::cos(static_cast<double>(p) + 1.3 * i);
    return m;
  }
  [[nodiscard]] bool observes_positions(int step) const {
    return step == steps / 2 || step == steps - 1;
  }
  [[nodiscard]] std::vector<std::size_t> bodies() const {
    std::vector<std::size_t> all(scene.bodies.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    return all;
  }

  template <class S>
  double run(std::vector<UpdatedRecord<S>>* records) const {
    Arena arena(1);
    UpdatedGroup<S> group(scene, bodies(), kernels<S>(SimdTarget::kAuto), std::size_t{1} << 30U);
    double sum = 0.0;
    for (int n = 0; n < steps; ++n) {
      if (n == 0 || n == second_frame) (void)group.begin_frame(n * dt);
      UpdatedRecord<S>* record = nullptr;
      if (records != nullptr) record = &records->emplace_back();
      (void)group.step(arena, n * dt, dt, scene.gravity.at(n * dt), record);
      if (!observes_positions(n)) continue;
      for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        const std::vector<UpdatedParticle> particles = group.particles(b);
        for (std::size_t p = 0; p < particles.size(); ++p) {
          sum += scale * weight(p).dot(particles[p].position);
          if (n + 1 < steps) continue;
          sum += weight(p + 7).dot(particles[p].velocity) +
                 strain_weight(p).cwiseProduct(particles[p].deformation_gradient).sum();
        }
      }
    }
    return sum;
  }

  template <class S>
  Gradient gradient(const std::vector<UpdatedRecord<S>>& records, int threads = 1) const {
    Arena arena(threads);
    UpdatedAdjoint<S> adjoint(scene, bodies(), updated_adjoint_kernels<S>(SimdTarget::kAuto));
    UpdatedCotangents<S> bar = adjoint.zero(of_published);
    for (int n = steps - 1; n >= 0; --n) {
      if (observes_positions(n)) observe(n, bar);
      adjoint.substep(arena, records[static_cast<std::size_t>(n)], bar);
    }
    Gradient g;
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
      g.start.push_back(adjoint.start(arena, b, bar));
      g.material.push_back(adjoint.material_gradient(b, bar));
    }
    g.gravity = bar.gravity;
    g.colliders = bar.colliders;
    return g;
  }
  template <class S>
  Gradient gradient(int threads = 1) const {
    std::vector<UpdatedRecord<S>> records;
    (void)run<S>(&records);
    return gradient(records, threads);
  }

  template <class S>
  void observe(int step, UpdatedCotangents<S>& bar) const {
    for (UpdatedBodyCotangents<S>& body : bar.bodies) {
      for (std::size_t p = 0; p < body.particles.size(); ++p) {
        UpdatedParticleBar<S>& particle = body.particles[p];
        for (std::size_t c = 0; c < 3; ++c) {
          particle.position[c] += static_cast<S>(scale * weight(p)[static_cast<int>(c)]);
          if (step + 1 < steps) continue;
          particle.velocity[c] += static_cast<S>(weight(p + 7)[static_cast<int>(c)]);
        }
        for (std::size_t i = 0; i < 9 && step + 1 == steps; ++i) {
          particle.h[i] +=
              static_cast<S>(strain_weight(p)(static_cast<int>(i / 3), static_cast<int>(i % 3)));
        }
      }
    }
  }

  /// `found` to 1e-6 of the size of the fourth-order central difference when `move(scene, by)`
  /// changes the scene, or of `least` where that is larger. Where a particle begins to yield or to
  /// touch between the two sides the difference is none: then a smaller step counts.
  void expect(double found, double least, const std::string& what, double step,
              const std::function<void(Scene&, double)>& move, double factor = 1.0) {
    const auto value = [&](double by) {
      UpdatedRollout moved = *this;
      move(moved.scene, by);
      return moved.run<double>(nullptr);
    };
    double best = 1e300;
    double expected = 0.0;
    for (int k = 0; k < 4 && best > 1e-6; ++k) {
      expected = factor *
                 (8.0 * (value(step) - value(-step)) - (value(2.0 * step) - value(-2.0 * step))) /
                 (12.0 * step);
      best = std::min(best, std::abs(expected - found) / std::max(std::abs(expected), least));
      step *= 0.1;
    }
    worst = std::max(worst, best);
    EXPECT_LE(best, 1e-6) << what << ": difference " << expected << ", adjoint " << found;
  }

  /// What every body has: motion, place, density, gravity.
  void expect_start(const Gradient& g, double least, const std::string& name) {
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
      const StartCotangents& start = g.start[b];
      Vec3d offset = Vec3d::Zero();
      for (const Vec3d& x : start.positions) offset += x;
      for (int axis = 0; axis < 3; ++axis) {
        expect(start.velocity[axis], least, name + ", velocity", 1e-3,
               [&](Scene& s, double by) { s.bodies[b].velocity[axis] += by; });
        expect(start.spin[axis], least, name + ", spin", 1e-2,
               [&](Scene& s, double by) { s.bodies[b].spin[axis] += by; });
        expect(offset[axis], least, name + ", offset", 1e-5, [&](Scene& s, double by) {
          for (Vec3d& x : s.bodies[b].rest) x[axis] += by;
        });
      }
      const double density = scene.bodies[b].density;
      expect(
          start.log_density, least, name + ", density", 1e-3 * density,
          [&](Scene& s, double by) { s.bodies[b].density += by; }, density);
      // All particles at once, along a direction.
      double of_velocities = 0.0;
      double of_places = 0.0;
      for (std::size_t p = 0; p < start.positions.size(); ++p) {
        of_velocities += weight(p + 3).dot(start.particle_velocities[p]);
        of_places += weight(p + 5).dot(start.positions[p]);
      }
      expect(of_velocities, least, name + ", particle velocities", 1e-3, [&](Scene& s, double by) {
        Body& body = s.bodies[b];
        body.particle_velocities.resize(body.rest.size(), Vec3d::Zero());
        for (std::size_t p = 0; p < body.rest.size(); ++p) {
          body.particle_velocities[p] += by * weight(p + 3);
        }
      });
      expect(of_places, least, name + ", particle places", 1e-5, [&](Scene& s, double by) {
        for (std::size_t p = 0; p < s.bodies[b].rest.size(); ++p) {
          s.bodies[b].rest[p] += by * weight(p + 5);
        }
      });
    }
    for (int axis = 0; axis < 3; ++axis) {
      expect(g.gravity[axis], 0.1 * least, name + ", gravity", 1e-2,
             [&](Scene& s, double by) { s.gravity.values[0][axis] += by; });
    }
  }
};

/// A block of 4 × 4 × `high` particles `h` apart, out of line, that spins, shears and falls.
inline Body updated_block_body(const material::Material& material, const Vec3d& corner, int high,
                               double h, unsigned seed) {
  Body body;
  body.name = "block " + std::to_string(seed);
  body.density = 900.0;
  body.formulation = Formulation::kUpdated;
  body.material = material;
  body.velocity = Vec3d(0.8, -0.6, 0.5);
  body.spin = Vec3d(4.0, -3.0, 6.0);
  std::mt19937 random(seed);
  const auto uniform = [&] { return 2.0 * static_cast<double>(random()) / 4294967295.0 - 1.0; };
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < high; ++k) {
        const Vec3d x = h * Vec3d(i + 0.5 + 0.2 * uniform(), j + 0.5 + 0.2 * uniform(),
                                  k + 0.5 + 0.2 * uniform());
        body.rest.push_back(x + corner);
        body.volumes.push_back(h * h * h * (1.0 + 0.1 * uniform()));
        body.particle_velocities.push_back(Vec3d(uniform(), uniform(), uniform()) +
                                           15.0 * Vec3d(x.z() - 0.05, 0.5 * x.x(), -x.y()));
      }
  return body;
}

}  // namespace matterfit::mpm
