// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/spherical_harmonics.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "splat/sh_basis-inl.hpp"

namespace matterfit::capture {
namespace {

/// An index into arrays from numbers that are int, as degrees and orders are.
constexpr std::size_t sh_place(int index) { return static_cast<std::size_t>(index); }

constexpr int kDirections = 16;

struct ShProjection {
  std::array<Vec3d, kDirections> directions;
  /// B⁺ of degree l: (2l + 1) × kDirections.
  std::array<Eigen::MatrixXd, kMaxShDegree> inverse;
};

const ShProjection& projection() {
  static const ShProjection result = [] {
    ShProjection p;
    for (int k = 0; k < kDirections; ++k) {
      // A Fibonacci spiral: well spread, and no plane of symmetry.
      const double z = 1.0 - (2.0 * k + 1.0) / kDirections;
      const double r = std::sqrt(1.0 - z * z);
      const double angle = std::numbers::pi * (3.0 - std::sqrt(5.0)) * k;
      p.directions[static_cast<std::size_t>(k)] =
          Vec3d(r * std::cos(angle), r * std::sin(angle), z);
    }
    for (int l = 1; l <= kMaxShDegree; ++l) {
      Eigen::MatrixXd basis(kDirections, 2 * l + 1);
      for (int k = 0; k < kDirections; ++k) {
        const auto values = sh_basis(p.directions[static_cast<std::size_t>(k)]);
        for (int m = 0; m < 2 * l + 1; ++m) basis(k, m) = values[sh_place(l * l + m)];
      }
      p.inverse[static_cast<std::size_t>(l - 1)] =
          basis.completeOrthogonalDecomposition().pseudoInverse();
    }
    return p;
  }();
  return result;
}

}  // namespace

std::array<double, kMaxShBands> sh_basis(const Vec3d& d) {
  const double at[3] = {d[0], d[1], d[2]};
  double values[kMaxShBands];
  HWY_NAMESPACE::sh_basis(kMaxShDegree, at, values);
  std::array<double, kMaxShBands> result;
  std::copy_n(values, kMaxShBands, result.begin());
  return result;
}

ShRotation::ShRotation(const Mat3d& rotation) {
  const ShProjection& p = projection();
  std::array<std::array<double, kMaxShBands>, kDirections> turned{};
  for (std::size_t k = 0; k < kDirections; ++k) {
    turned[k] = sh_basis(rotation.transpose() * p.directions[k]);
  }
  for (int l = 1; l <= kMaxShDegree; ++l) {
    const int size = 2 * l + 1;
    const Eigen::MatrixXd& inverse = p.inverse[static_cast<std::size_t>(l - 1)];
    auto& matrix = matrices_[static_cast<std::size_t>(l - 1)];
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) {
        double sum = 0.0;
        for (int k = 0; k < kDirections; ++k) {
          sum += inverse(i, k) * turned[sh_place(k)][sh_place(l * l + j)];
        }
        matrix[sh_place(i * size + j)] = sum;
      }
    }
  }
}

void ShRotation::apply(std::span<float> coefficients, int degree) const {
  for (int l = 1; l <= degree; ++l) {
    const int size = 2 * l + 1;
    const auto& matrix = matrices_[static_cast<std::size_t>(l - 1)];
    std::array<double, 21> result{};
    for (int i = 0; i < size; ++i)
      for (int j = 0; j < size; ++j)
        for (int c = 0; c < 3; ++c) {
          result[sh_place(3 * i + c)] +=
              matrix[sh_place(i * size + j)] *
              static_cast<double>(coefficients[sh_place(3 * (l * l + j) + c)]);
        }
    for (int i = 0; i < 3 * size; ++i) {
      coefficients[sh_place(3 * l * l + i)] = static_cast<float>(result[sh_place(i)]);
    }
  }
}

Vec3d ShRotation::spin_bar(std::span<const float> turned, std::span<const float> bar, int degree) {
  // f of the further rotation is f(d − ω × d), so a coefficient moves by what the projection makes
  // of −(ω × d)·∇f(d) = −ω·(d × ∇f(d)).
  const ShProjection& p = projection();
  Vec3d sum = Vec3d::Zero();
  for (std::size_t k = 0; k < kDirections; ++k) {
    const Vec3d& d = p.directions[k];
    const double at[3] = {d[0], d[1], d[2]};
    for (int l = 1; l <= degree; ++l) {
      for (int c = 0; c < 3; ++c) {
        double coefficients[kMaxShBands] = {};
        double weight = 0.0;
        for (int i = 0; i <= 2 * l; ++i) {
          const std::size_t place = sh_place(3 * (l * l + i) + c);
          coefficients[l * l + i] = static_cast<double>(turned[place]);
          weight +=
              p.inverse[sh_place(l - 1)](i, Eigen::Index(k)) * static_cast<double>(bar[place]);
        }
        double slope[3];
        HWY_NAMESPACE::sh_basis_adjoint(degree, at, coefficients, slope);
        sum -= weight * d.cross(Vec3d(slope[0], slope[1], slope[2]));
      }
    }
  }
  return sum;
}

}  // namespace matterfit::capture
