// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_quadrature.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <tuple>

#include "mpm/spline_weights.hpp"

namespace matterfit::mpm {
namespace {

/// A block of nx × ny × nz boxes of half a cell, its low corner at `low` (node units).
std::vector<Vec3d> lattice(const Vec3i& count, const Vec3d& low) {
  std::vector<Vec3d> points;
  for (int x = 0; x < count[0]; ++x)
    for (int y = 0; y < count[1]; ++y)
      for (int z = 0; z < count[2]; ++z) {
        points.push_back(low + 0.5 * (Vec3d(x, y, z) + Vec3d::Constant(0.5)));
      }
  return points;
}

struct Moments {
  std::map<std::tuple<int, int, int>, double> weight;   ///< Σ V w
  std::map<std::tuple<int, int, int>, Vec3d> gradient;  ///< Σ V ∇w
};

Moments moments(const Quadrature& quadrature) {
  Moments m;
  for (const QuadraturePoint& q : quadrature.points) {
    double w[3][3];
    double g[3][3];
    for (int axis = 0; axis < 3; ++axis) {
      quadratic_weights(q.f[axis], w[axis]);
      g[axis][0] = -(1.5 - q.f[axis]);
      g[axis][1] = -2.0 * (q.f[axis] - 1.0);
      g[axis][2] = q.f[axis] - 0.5;
    }
    for (int i = 0; i < 27; ++i) {
      const int a = i / 9;
      const int b = i / 3 % 3;
      const int c = i % 3;
      const std::tuple<int, int, int> node(q.cell[0] + a, q.cell[1] + b, q.cell[2] + c);
      m.weight[node] += q.volume * w[0][a] * w[1][b] * w[2][c];
      m.gradient.try_emplace(node, Vec3d::Zero()).first->second +=
          q.volume * Vec3d(g[0][a] * w[1][b] * w[2][c], w[0][a] * g[1][b] * w[2][c],
                           w[0][a] * w[1][b] * g[2][c]);
    }
  }
  return m;
}

TEST(TotalQuadrature, KeepsVolumeAndStaticMomentForAnyPlaceInTheGrid) {
  for (const double shift : {0.0, 0.13, 0.25, 0.37, 0.61, 0.98}) {
    const std::vector<Vec3d> points = lattice({5, 4, 7}, Vec3d(shift, 0.3 + shift, 2.0 * shift));
    const std::vector<double> volumes(points.size(), 0.125);
    const Quadrature quadrature = cell_quadrature(points, volumes, 0.5);
    double volume = 0.0;
    Vec3d moment = Vec3d::Zero();
    for (const QuadraturePoint& q : quadrature.points) {
      volume += q.volume;
      moment += q.volume * (q.f + q.cell.cast<double>());
    }
    Vec3d expected = Vec3d::Zero();
    for (const Vec3d& x : points) expected += 0.125 * x;
    EXPECT_NEAR(volume, 0.125 * static_cast<double>(points.size()), 1e-12) << shift;
    EXPECT_LT((moment - expected).norm(), 1e-10) << shift;
  }
}

/// Column of boxes along z, wide enough that the middle sees no sides: a constant stress must give
/// what the tractions on both faces give, w(face), at every node.
TEST(TotalQuadrature, ConstantStressBalancesTheTractionsOfTheFaces) {
  for (const double shift : {0.0, 0.1, 0.25, 0.4, 0.55, 0.7, 0.9}) {
    const double low = 10.5 + shift;
    const Vec3i count(16, 16, 9);
    const std::vector<Vec3d> points = lattice(count, Vec3d(10.5, 10.5, low));
    const std::vector<double> volumes(points.size(), 0.125);
    const Quadrature quadrature = cell_quadrature(points, volumes, 0.5);
    const Moments m = moments(quadrature);
    // ∫ ∇w dV = ∮ w n dA; in x and y the node at 14 has its whole support inside.
    std::map<int, double> expected;
    for (const double face : {low, low + 0.5 * count[2]}) {
      const double side = face == low ? -1.0 : 1.0;
      const Vec3i base(14, 14,
                       static_cast<int>(std::floor(face - 0.5 + (side < 0 ? 1e-9 : -1e-9))));
      const Vec3i inside = quadrature.cell_at(base, base);
      double w[3];
      quadratic_weights(face - inside[2], w);
      for (int k = 0; k < 3; ++k) expected[inside[2] + k] += side * w[k];
    }
    for (const auto& [node, gradient] : m.gradient) {
      if (std::get<0>(node) != 14 || std::get<1>(node) != 14) continue;
      EXPECT_NEAR(gradient[2], expected[std::get<2>(node)], 1e-12)
          << "shift " << shift << ", node " << std::get<2>(node);
    }
  }
}

TEST(TotalQuadrature, FullCellsTakeGaussPoints) {
  const std::vector<Vec3d> points = lattice({8, 8, 8}, Vec3d(0.7, 0.9, 0.5));
  const Quadrature quadrature =
      cell_quadrature(points, std::vector<double>(points.size(), 0.125), 0.5);
  int gauss = 0;
  for (const QuadraturePoint& q : quadrature.points) {
    if (q.cell != Vec3i(2, 2, 2)) continue;
    ++gauss;
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(std::abs(q.f[axis] - 1.0), 0.5 / std::sqrt(3.0), 1e-12);
    }
  }
  EXPECT_EQ(gauss, 8);
}

/// However little of a cell the body fills, its points stay there, where no weight is negative.
TEST(TotalQuadrature, PointsStayInTheirOwnCells) {
  const std::vector<Vec3d> points = lattice({8, 8, 8}, Vec3d::Constant(0.3));
  const Quadrature quadrature =
      cell_quadrature(points, std::vector<double>(points.size(), 0.125), 0.5);
  EXPECT_EQ(quadrature.cell_at({-1, -1, -1}, {9, 9, 9}), Vec3i(-1, -1, -1));
  EXPECT_EQ(quadrature.cell_at({1, 1, 2}, {9, 9, 9}), Vec3i(1, 1, 2));
  EXPECT_EQ(quadrature.cell_at({-3, 1, 2}, {9, 9, 9}), Vec3i(9, 9, 9));
  for (const QuadraturePoint& q : quadrature.points) {
    EXPECT_LE((q.f - Vec3d::Ones()).cwiseAbs().maxCoeff(), 0.5);
  }
  for (const auto& [node, weight] : moments(quadrature).weight) EXPECT_GT(weight, 0.0);
}

TEST(TotalQuadrature, PointsWithoutALatticeStandForThemselves) {
  const std::vector<Vec3d> points = {{1.2, 3.4, 5.6}, {1.4, 3.4, 5.7}};
  const Quadrature quadrature = cell_quadrature(points, {0.1, 0.2}, 0.0);
  ASSERT_EQ(quadrature.points.size(), 2U);
  EXPECT_EQ(quadrature.filled.size(), 1U);
  EXPECT_DOUBLE_EQ(quadrature.points[1].volume, 0.2);
}

}  // namespace
}  // namespace matterfit::mpm
