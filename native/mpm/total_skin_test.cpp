// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_skin.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "mpm/halo.hpp"
#include "mpm/total_stencil.hpp"
#include "mpm/validation_shapes_for_test.hpp"

namespace matterfit::mpm {
namespace {

constexpr double kSkinDx = 0.02;

/// A ball whose lattice lies anywhere in its grid: nodes of every mass.
class Ties : public ::testing::Test {
 protected:
  Ties() {
    scene_.dx = kSkinDx;
    scene_.grid_shift = Vec3d(0.3, 0.6, 0.1);
    scene_.bodies.push_back(validation::ball_body("ball", Vec3d(1, 2, 3), 0.05, 0.5 * kSkinDx));
    grid_ = std::make_unique<TotalGrid>(scene_.bodies[0], scene_);
    ties_ = std::make_unique<SkinTies>(*grid_, scene_.bodies[0].density,
                                       std::vector<std::uint8_t>(grid_->mass().size(), 0));
  }
  template <class Value>
  [[nodiscard]] std::vector<double> field(const Value& value) const {
    std::vector<double> out(grid_->mass().size() * 3, 0.0);
    for (std::uint32_t n = 0; n < grid_->mass().size(); ++n) {
      if (grid_->mass()[n] > 0.0) set_field_value(out, n, value(grid_->node_position(n)));
    }
    return out;
  }
  [[nodiscard]] std::vector<double> forces(const std::vector<double>& u, double modulus) const {
    std::vector<double> out(u.size(), 0.0);
    for (std::size_t b = 0; b < grid_->node_blocks(); ++b) {
      ties_->add_forces(b, modulus, u.data(), out.data() + b * kNodeBlock);
    }
    return out;
  }
  [[nodiscard]] static double dot(const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
  }

  Scene scene_;
  std::unique_ptr<TotalGrid> grid_;
  std::unique_ptr<SkinTies> ties_;
};

TEST_F(Ties, LetAnyMotionPassThatIsQuadratic) {
  ASSERT_TRUE(ties_->any());
  Mat3d turn;
  turn << -2, 1, 0.5, 0.2, -1, 3, 0.4, 0.1, 5;
  const std::vector<double> f =
      forces(field([&](const Vec3d& x) -> Vec3d {
               return Vec3d(7, 8, 9) + turn * x + x[1] * x[1] * Vec3d(1, 2, 3);
             }),
             1e5);
  for (const double value : f) EXPECT_NEAR(value, 0.0, 1e-8);
}

/// ½ γ μ V (Δ³u/dx)²: forces of a symmetric matrix that takes energy and never gives any, without a
/// resultant.
TEST_F(Ties, AreSymmetricAndPositive) {
  const std::vector<double> a =
      field([](const Vec3d& x) { return Vec3d(std::sin(300 * x[0]), std::cos(90 * x[2]), x[1]); });
  const std::vector<double> b =
      field([](const Vec3d& x) { return Vec3d(std::cos(200 * x[1]), x[0], std::sin(250 * x[2])); });
  EXPECT_LT(dot(a, forces(a, 1e5)), 0.0);
  EXPECT_LT(dot(b, forces(b, 1e5)), 0.0);
  EXPECT_NEAR(dot(a, forces(b, 1e5)), dot(b, forces(a, 1e5)),
              1e-9 * std::abs(dot(a, forces(a, 1e5))));
  const std::vector<double> ones = field([](const Vec3d&) { return Vec3d::Ones().eval(); });
  EXPECT_NEAR(dot(ones, forces(a, 1e5)), 0.0, 1e-9);
}

/// However light a node is, it gets no faster than the cells themselves: ω² below 30 μ/(ρ dx²), a
/// third of which a lattice of full cells has.
TEST_F(Ties, MakeNoNodeFast) {
  const double density = scene_.bodies[0].density;
  std::vector<double> mode = field(
      [](const Vec3d& x) { return Vec3d(std::sin(310 * x[0] + x[1]), std::cos(170 * x[2]), 1); });
  double omega_squared = 0.0;
  for (int i = 0; i < 60; ++i) {
    std::vector<double> next = forces(mode, 1.0);
    for (std::size_t k = 0; k < next.size(); ++k) next[k] *= -grid_->inverse_mass()[node_of(k)];
    omega_squared = std::sqrt(dot(next, next) / dot(mode, mode));
    const double scale = 1.0 / std::sqrt(dot(next, next));
    for (std::size_t k = 0; k < next.size(); ++k) mode[k] = scale * next[k];
  }
  EXPECT_GT(omega_squared, 0.0);
  EXPECT_LT(omega_squared * density * kSkinDx * kSkinDx, 30.0);
}

}  // namespace
}  // namespace matterfit::mpm
