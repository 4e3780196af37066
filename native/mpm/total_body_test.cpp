// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_body.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/parallel.hpp"
#include "mpm/spline_weights.hpp"
#include "mpm/validation_shapes_for_test.hpp"

namespace matterfit::mpm {
namespace {

using validation::ball_body;
using validation::box_body;

constexpr double kBodyDx = 0.02;

Scene scene_of(Body body) {
  Scene scene;
  scene.dx = kBodyDx;
  body.formulation = Formulation::kTotal;
  scene.bodies.push_back(std::move(body));
  return scene;
}

/// A field over the nodes by its place, the same for all components.
template <class Value>
std::vector<double> field_of(const TotalGrid& grid, const Value& value) {
  std::vector<double> field(grid.mass().size() * 3, 0.0);
  for (std::uint32_t n = 0; n < grid.mass().size(); ++n) {
    if (!(grid.mass()[n] > 0.0)) continue;
    for (std::size_t c = 0; c < 3; ++c) field[component_of(n, c)] = value(grid.node_position(n));
  }
  return field;
}

double momentum(const TotalGrid& grid, const std::vector<double>& field) {
  double sum = 0.0;
  for (std::uint32_t n = 0; n < grid.mass().size(); ++n) {
    sum += grid.mass()[n] * field[component_of(n, 1)];
  }
  return sum;
}

/// With a ball, whose skin has cells that are nearly empty.
TEST(CorrectedLumping, KeepsUniformFieldsAndMomentum) {
  const Scene scene = scene_of(ball_body("ball", Vec3d(0.1, 0.2, 0.3), 0.07, 0.5 * kBodyDx));
  Arena arena(1);
  TotalBody<double> body(scene.bodies[0], scene, kernels<double>(SimdTarget::kAuto));
  const TotalGrid& grid = body.grid();
  const std::vector<double> uniform = field_of(grid, [](const Vec3d&) { return 2.0; });
  std::vector<double> corrected = uniform;
  body.correct_lumping(arena, corrected);
  for (std::size_t i = 0; i < uniform.size(); ++i) ASSERT_NEAR(corrected[i], uniform[i], 1e-12);

  const std::vector<double> wave =
      field_of(grid, [](const Vec3d& x) { return std::sin(60.0 * x[0]) + 30.0 * x[2]; });
  corrected = wave;
  body.correct_lumping(arena, corrected);
  EXPECT_NEAR(momentum(grid, corrected), momentum(grid, wave), 1e-12 * grid.total_mass() * 30.0);
  // M⁻¹ (M − B) is not negative: energy of the change, and no more than the field's own.
  double change = 0.0;
  double own = 0.0;
  for (std::size_t i = 0; i < wave.size(); ++i) {
    const double m = grid.mass()[node_of(i)];
    change += m * wave[i] * (corrected[i] - wave[i]);
    own += m * wave[i] * wave[i];
  }
  EXPECT_GT(change, 1e-3 * own);
  EXPECT_LT(change, own);
}

/// Nodes that the skin of a ball hardly reaches are raised, and neither the mass nor its centre
/// moves by that.
TEST(TotalGrid, ReachesThePlanesOfTheSkinAndElseTheFaceOfTheBox) {
  mpm::Body body = ball_body("ball", Vec3d::Zero(), 0.07, 0.5 * kBodyDx);
  const double side = std::cbrt(body.volumes[7]);
  const Vec3d out = Vec3d(1.0, 2.0, -1.0).normalized();
  body.skin = {{7, out, 0.8 * side}};
  const Scene scene = scene_of(body);
  const TotalGrid grid(scene.bodies[0], scene);
  // Straight at the plane, to it; aside, or a particle without one, to the face of the box.
  EXPECT_NEAR(grid.reach(7, out).distance, 0.8 * side, 1e-12);
  EXPECT_NEAR(grid.reach(7, -out).distance, 0.5 * side, 1e-12);
  EXPECT_NEAR(grid.reach(8, out).distance, 0.5 * std::cbrt(body.volumes[8]), 1e-12);
  const Vec3d tilted = (out + 0.3 * out.unitOrthogonal()).normalized();
  EXPECT_NEAR(grid.reach(7, tilted).distance, 0.8 * side, 1e-12);
  const Vec3d aside = (out + 2.0 * out.unitOrthogonal()).normalized();
  EXPECT_NEAR(grid.reach(7, aside).distance, 0.5 * side, 1e-12);
  // Two that are faced alike count alike.
  body.skin.push_back({7, (out + 0.5 * out.unitOrthogonal()).normalized(), 1.0 * side});
  const Scene both = scene_of(body);
  const Vec3d middle = (body.skin[0].normal + body.skin[1].normal).normalized();
  EXPECT_NEAR(TotalGrid(both.bodies[0], both).reach(7, middle).distance, 0.9 * side, 1e-12);
  // Between, it goes over without a jump, and its slope is that of differences.
  for (double angle = 0.0; angle < 3.0; angle += 0.037) {
    const auto at = [&](double a) -> Vec3d {
      return std::cos(a) * out + std::sin(a) * out.unitOrthogonal();
    };
    const double step = 1e-6;
    const double rise =
        grid.reach(7, at(angle + step)).distance - grid.reach(7, at(angle - step)).distance;
    EXPECT_LT(std::abs(rise), 20.0 * side * step) << angle;
    const Vec3d along = (at(angle + step) - at(angle - step)) / (2.0 * step);
    EXPECT_NEAR(grid.reach(7, at(angle)).slope.dot(along), rise / (2.0 * step), 1e-5 * side)
        << angle;
  }
}

TEST(TotalGrid, RaisesLightNodesWithinTheBody) {
  const Scene scene = scene_of(ball_body("ball", Vec3d(0.1, 0.2, 0.3), 0.07, 0.5 * kBodyDx));
  const TotalGrid grid(scene.bodies[0], scene);
  const double least = 0.99e-3 * 1000.0 * kBodyDx * kBodyDx * kBodyDx;
  int light = 0;
  double mass = 0.0;
  Vec3d moment = Vec3d::Zero();
  for (std::uint32_t n = 0; n < grid.mass().size(); ++n) {
    const double lumped = grid.lumped_mass()[n];
    EXPECT_EQ(grid.mass()[n] > 0.0, lumped > 0.0);
    if (!(lumped > 0.0)) continue;
    light += lumped < least ? 1 : 0;
    EXPECT_GE(grid.mass()[n], least);
    EXPECT_GE(grid.mass()[n], 0.7 * lumped);
    mass += grid.mass()[n];
    moment += (grid.mass()[n] - lumped) * grid.node_position(n);
  }
  EXPECT_GT(light, 0);
  EXPECT_NEAR(mass, grid.total_mass(), 1e-12 * grid.total_mass());
  EXPECT_LT(moment.norm(), 1e-12 * grid.total_mass() * kBodyDx);
}

/// B/M for a wave of k radians a cell along an axis, by two Gauss points a cell:
/// the mean of |Σ w_j(f) exp(ikj)|².
double mass_of_wave(double k) {
  double sum = 0.0;
  for (const double side : {-0.5, 0.5}) {
    double w[3];
    quadratic_weights(1.0 + side / std::sqrt(3.0), w);
    const double real = w[0] + w[1] * std::cos(k) + w[2] * std::cos(2.0 * k);
    const double imaginary = w[1] * std::sin(k) + w[2] * std::sin(2.0 * k);
    sum += 0.5 * (real * real + imaginary * imaginary);
  }
  return sum;
}

/// In the middle of a block of full cells.
TEST(CorrectedLumping, OfAWaveIsTwiceItLessTheMassMatrix) {
  const Scene scene =
      scene_of(box_body("box", Vec3d::Zero(), Vec3d(16, 8, 8) * kBodyDx, 0.5 * kBodyDx));
  Arena arena(1);
  TotalBody<double> body(scene.bodies[0], scene, kernels<double>(SimdTarget::kAuto));
  const TotalGrid& grid = body.grid();
  for (const double k : {0.3, 1.0, std::numbers::pi}) {
    const auto wave = [&](const Vec3d& x) { return std::cos(k * x[0] / kBodyDx); };
    const std::vector<double> before = field_of(grid, wave);
    std::vector<double> after = before;
    body.correct_lumping(arena, after);
    const double expected = 2.0 - mass_of_wave(k);
    int seen = 0;
    for (std::uint32_t n = 0; n < grid.mass().size(); ++n) {
      const Vec3d x = grid.node_position(n) / kBodyDx;
      if ((x - Vec3d(8, 4, 4)).cwiseAbs().maxCoeff() > 1.1) continue;
      const std::size_t i = component_of(n, 0);
      EXPECT_NEAR(after[i], expected * before[i], 1e-9);
      ++seen;
    }
    EXPECT_GT(seen, 7);
  }
}

}  // namespace
}  // namespace matterfit::mpm
