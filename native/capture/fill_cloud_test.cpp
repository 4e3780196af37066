// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "base/error.hpp"
#include "capture/fill.hpp"

namespace matterfit::capture {
namespace {

using ::testing::HasSubstr;

FillOptions at(double separation) {
  FillOptions options;
  options.separation = separation;
  return options;
}

double sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

TEST(FillPoints, LatticeIsRecognised) {
  FillOptions options = at(0.02);
  options.axes = Quatd(Eigen::AngleAxisd(0.6, Vec3d(1, 0, 2).normalized()));
  auto source = fill_box(Vec3d::Zero(), Vec3d(0.1, 0.2, 0.16), at(0.02));
  place(source, Vec3d(1, 2, 3), options.axes);
  const auto body = fill_points(source.positions, options);
  EXPECT_TRUE(body.lattice.regular);
  EXPECT_NEAR(sum(body.volumes), 0.1 * 0.2 * 0.16, 1e-9);
  for (const double volume : body.volumes) EXPECT_NEAR(volume, 8e-6, 1e-12);
  const Vec3d cell = (body.lattice.axes.conjugate() * (body.positions[5] - body.lattice.origin)) /
                         body.lattice.spacing -
                     Vec3d::Constant(0.5);
  EXPECT_NEAR((cell - Vec3d(cell.array().round())).norm(), 0.0, 1e-6);
  EXPECT_THAT(body.report, HasSubstr("regular lattice"));
}

TEST(FillPoints, JitteredBallHasTheBallsVolume) {
  FillOptions options = at(0.05);
  options.jitter = true;
  const auto source = fill_sphere(Vec3d(3, 0, 0), 0.5, options);
  const auto body = fill_points(source.positions, at(0.05));
  const double volume = 4.0 / 3.0 * std::numbers::pi * 0.125;
  EXPECT_FALSE(body.lattice.regular);
  EXPECT_NEAR(body.volume, volume, 0.06 * volume);
  EXPECT_NEAR(sum(body.volumes), body.volume, 1e-9);
  const auto given = fill_points(source.positions, at(0.05), 2.0);
  EXPECT_NEAR(sum(given.volumes), 2.0, 1e-9);
}

TEST(FillHull, OfIrregularPointsIsALatticeOfTheirBody) {
  FillOptions options = at(0.05);
  options.jitter = true;
  const auto source = fill_sphere(Vec3d(3, 0, 0), 0.5, options);
  const auto body = fill_hull(source.positions, at(0.05));
  const double volume = 4.0 / 3.0 * std::numbers::pi * 0.125;
  EXPECT_TRUE(body.lattice.regular);
  EXPECT_DOUBLE_EQ(body.lattice.spacing, 0.05);
  EXPECT_NEAR(sum(body.volumes), volume, 0.06 * volume);
  for (const Vec3d& x : body.positions) EXPECT_LT((x - Vec3d(3, 0, 0)).norm(), 0.55);
  EXPECT_THAT(body.report, HasSubstr("hull"));
}

TEST(FillHull, LeavesALatticeAsItIs) {
  const auto source = fill_box(Vec3d::Zero(), Vec3d(0.4, 0.2, 0.2), at(0.05));
  const auto body = fill_hull(source.positions, at(0.1));
  EXPECT_EQ(body.positions, source.positions);
}

TEST(FillPoints, Refusals) {
  EXPECT_THROW((void)fill_points({Vec3d::Zero()}, at(0.1)), Error);
  EXPECT_THROW((void)fill_points(Points(10, Vec3d::Zero()), at(0.1)), Error);
  EXPECT_THROW((void)fill_points({Vec3d::Zero(), Vec3d::Constant(NAN)}, at(0.1)), Error);
}

/// Flat splats all over a sphere, as a trainer leaves them: nothing inside.
GaussianArrays splat_ball(double radius, std::size_t count, double opening) {
  GaussianArrays splats;
  const double turn = std::numbers::pi * (3.0 - std::sqrt(5.0));
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 1.0 - 2.0 * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double angle = turn * static_cast<double>(i);
    const double r = std::sqrt(1.0 - z * z);
    const Vec3d n(r * std::cos(angle), r * std::sin(angle), z);
    if (z < opening) continue;
    const double side = radius * std::sqrt(4.0 * std::numbers::pi / static_cast<double>(count));
    splats.centres.push_back(radius * n);
    splats.scales.emplace_back(side, side, 1e-4 * radius);
    splats.rotations.push_back(Quatd::FromTwoVectors(Vec3d::UnitZ(), n));
    splats.opacities.push_back(0.9);
  }
  return splats;
}

TEST(FillGaussians, HollowBallIsFilled) {
  const double h = 0.02;
  const auto splats = splat_ball(0.3, 2000, -2.0);
  const auto body = fill_gaussians(splats, at(h));
  // Flat splats with a spread of .08 R bulge at a curved surface; a quarter of a separation is
  // left.
  const auto ball = [](double r) { return 4.0 / 3.0 * std::numbers::pi * r * r * r; };
  EXPECT_GT(body.volume, ball(0.3 - 0.25 * h));
  EXPECT_LT(body.volume, ball(0.3 + 0.25 * h));
  bool centre = false;
  for (const Vec3d& x : body.positions) centre = centre || x.norm() < h;
  EXPECT_TRUE(centre);
  EXPECT_THAT(body.report, HasSubstr("inside filled"));

  GaussianFillOptions shell;
  shell.fill_inside = false;
  const auto hollow = fill_gaussians(splats, at(h), shell);
  EXPECT_LT(hollow.volume, 0.5 * body.volume);
  for (const Vec3d& x : hollow.positions) EXPECT_GT(x.norm(), 0.2);
}

TEST(FillGaussians, SmallGapIsBridged) {
  // Open at the bottom where no camera looked: a disc of radius .3·sin ≈ .042 is missing.
  const auto body = fill_gaussians(splat_ball(0.3, 2000, -0.99), at(0.02), {.closing = 3.0});
  bool centre = false;
  for (const Vec3d& x : body.positions) centre = centre || x.norm() < 0.03;
  EXPECT_TRUE(centre) << body.report;
}

TEST(FillGaussians, Refusals) {
  auto splats = splat_ball(0.3, 100, -2.0);
  for (double& opacity : splats.opacities) opacity = 0.01;
  EXPECT_THROW((void)fill_gaussians(splats, at(0.02)), Error);
  splats = splat_ball(0.3, 100, -2.0);
  splats.scales[3] = Vec3d::Constant(1e4);
  EXPECT_THROW((void)fill_gaussians(splats, at(0.02)), Error);
  splats.scales.pop_back();
  EXPECT_THROW((void)fill_gaussians(splats, at(0.02)), Error);
}

}  // namespace
}  // namespace matterfit::capture
