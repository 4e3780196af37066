// SPDX-License-Identifier: GPL-3.0-or-later
// The adjoint of a particle's contact against central differences: pressing, sticking, sliding,
// pulling, of every kind.
#include "mpm/contact_law_adjoint.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace matterfit::mpm {
namespace {

constexpr double kVolume = 1.6e-5;
constexpr double kDt = 3e-4;

/// A particle over a surface, and a number that depends on its force and on what it remembers.
struct Touch {
  ContactLaw law;
  shape::SurfacePoint surface;
  Mat3d f;
  double density = 1100.0;
  Vec3d velocity;
  ContactMemory memory;
  Vec3d force_weight;
  Vec3d stretch_weight;

  [[nodiscard]] ContactPoint point() const {
    shape::SurfacePoint at = surface;
    // As a free variable the normal has any length; the law expects a unit one.
    return contact_point(at, f, kVolume, density, velocity);
  }
  [[nodiscard]] double value() const {
    ContactMemory after = memory;
    const Vec3d force = contact_force(law, point(), 0, kDt, after);
    return force_weight.dot(force) +
           stretch_weight.dot(Eigen::Map<const Vec3d>(after.stretch.data()));
  }
};

double derivative(double& x, double step, const std::function<double()>& value) {
  const double at = x;
  const auto moved = [&](double by) {
    x = at + by;
    const double v = value();
    x = at;
    return v;
  };
  return (8.0 * (moved(step) - moved(-step)) - (moved(2.0 * step) - moved(-2.0 * step))) /
         (12.0 * step);
}

TEST(ContactAdjoint, MatchesDifferencesForEveryKindAndState) {
  std::mt19937 random(31);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&] { return Vec3d(uniform(random), uniform(random), uniform(random)); };
  int touching = 0;
  int sliding = 0;
  for (const shape::ContactKind kind :
       {shape::ContactKind::kGlue, shape::ContactKind::kSlip, shape::ContactKind::kSeparating,
        shape::ContactKind::kFriction, shape::ContactKind::kNoSlip}) {
    for (int repeat = 0; repeat < 40; ++repeat) {
      Touch t;
      t.law = {kind, repeat % 2 == 0 ? 0.1 : 3.0, 4e6, 0.2, repeat % 4 < 2 ? 0.0 : 2e-2};
      t.surface.normal = vector().normalized();
      t.surface.distance = 0.01 + 0.008 * uniform(random);
      t.surface.velocity = 0.2 * vector();
      t.f = Mat3d::Identity() + 0.2 * (Mat3d() << vector(), vector(), vector()).finished();
      t.velocity = 0.5 * vector();
      t.memory.surface = repeat % 3 == 0 ? -1 : 0;
      const Vec3d stretch = repeat % 3 == 0 ? Vec3d(Vec3d::Zero()) : Vec3d(1e-4 * vector());
      Eigen::Map<Vec3d>(t.memory.stretch.data()) = stretch;
      t.force_weight = vector();
      t.stretch_weight = 1e3 * vector();
      const ContactPoint point = t.point();
      if (std::abs(point.radius - point.distance) < 1e-4) continue;  // on the kink
      const ContactCotangents bar =
          contact_force_adjoint(t.law, point, 0, kDt, t.memory, t.force_weight, t.stretch_weight);
      const ContactPointCotangents back =
          contact_point_adjoint(t.surface.normal, t.f, kVolume, bar);
      touching += bar.distance != 0.0 ? 1 : 0;
      sliding += bar.mu != 0.0 ? 1 : 0;
      const auto value = [&] { return t.value(); };
      const auto expect = [&](double& x, double step, double found, const char* what) {
        // Twice, so that a change of state between the two sides shows.
        const double coarse = derivative(x, step, value);
        const double fine = derivative(x, 0.1 * step, value);
        const double size = std::max(std::abs(fine), 1e-2 / step * 1e-3);
        EXPECT_LT(std::min(std::abs(coarse - found), std::abs(fine - found)), 1e-6 * size)
            << what << ", kind " << static_cast<int>(kind) << ", " << repeat << ": " << fine
            << " and " << found;
      };
      expect(t.surface.distance, 1e-6, bar.distance, "distance");
      for (int i = 0; i < 3; ++i) {
        expect(t.surface.normal[i], 1e-5, bar.normal[i] + back.normal[i], "normal");
        expect(t.velocity[i], 1e-4, bar.relative_velocity[i], "velocity");
        for (int j = 0; j < 3; ++j) {
          expect(t.f(i, j), 1e-5, back.deformation_gradient(i, j), "F");
        }
        if (t.memory.surface == 0) {
          expect(t.memory.stretch[static_cast<std::size_t>(i)], 1e-8, bar.stretch[i], "stretch");
        }
      }
      expect(t.law.stiffness, 1e1, bar.stiffness, "stiffness");
      expect(t.law.mu, 1e-4, bar.mu, "mu");
      expect(t.law.damping, 1e-4, bar.damping, "damping");
      expect(t.density, 1e-1, back.density, "density");
    }
  }
  EXPECT_GT(touching, 40);
  EXPECT_GT(sliding, 5);
}

}  // namespace
}  // namespace matterfit::mpm
