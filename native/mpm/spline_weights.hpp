// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "base/vec.hpp"

namespace matterfit::mpm {

/// Quadratic B-spline at the three nodes of a cell, f = x/dx − base ∈ [½, 3/2): the scalar twin of
/// the kernels' spline_weights, for what is done a particle at a time.
template <class S>
void quadratic_weights(S f, S w[3]) {
  const S a = S(1.5) - f;
  const S b = f - S(1);
  const S c = f - S(0.5);
  w[0] = S(0.5) * a * a;
  w[1] = S(0.75) - b * b;
  w[2] = S(0.5) * c * c;
}

/// A cell's node [cells].
[[nodiscard]] inline Vec3d stencil_node(std::size_t i, std::size_t j, std::size_t k) {
  return {static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)};
}

/// Weights and gradients [1/m] of a cell's 27 nodes at f = x/dx − base. Outside the cell its
/// polynomial goes on.
struct PointStencil {
  double w[3][3];
  double g[3][3];

  PointStencil(const Vec3d& f, double dx) {
    const double inverse_dx = 1.0 / dx;
    for (int axis = 0; axis < 3; ++axis) {
      quadratic_weights(f[axis], w[axis]);
      g[axis][0] = (f[axis] - 1.5) * inverse_dx;
      g[axis][1] = -2.0 * (f[axis] - 1.0) * inverse_dx;
      g[axis][2] = (f[axis] - 0.5) * inverse_dx;
    }
  }
  [[nodiscard]] double weight(std::size_t i, std::size_t j, std::size_t k) const {
    return w[0][i] * w[1][j] * w[2][k];
  }
  [[nodiscard]] Vec3d gradient(std::size_t i, std::size_t j, std::size_t k) const {
    return {g[0][i] * w[1][j] * w[2][k], w[0][i] * g[1][j] * w[2][k], w[0][i] * w[1][j] * g[2][k]};
  }
  /// Second derivatives of a weight [1/m²].
  [[nodiscard]] Mat3d curvature(std::size_t i, std::size_t j, std::size_t k, double dx) const {
    constexpr double kCurve[3] = {1.0, -2.0, 1.0};
    const double scale = 1.0 / (dx * dx);
    const double xy = g[0][i] * g[1][j] * w[2][k];
    const double xz = g[0][i] * w[1][j] * g[2][k];
    const double yz = w[0][i] * g[1][j] * g[2][k];
    Mat3d m;
    m << scale * kCurve[i] * w[1][j] * w[2][k], xy, xz,  //
        xy, scale * w[0][i] * kCurve[j] * w[2][k], yz,   //
        xz, yz, scale * w[0][i] * w[1][j] * kCurve[k];
    return m;
  }
};

}  // namespace matterfit::mpm
