// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/serial_mpm.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace matterfit::bench {
namespace {

using Matrix = std::array<float, 9>;

Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      c[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
  return c;
}

Matrix multiply_transposed(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      c[3 * i + j] =
          a[3 * i] * b[3 * j] + a[3 * i + 1] * b[3 * j + 1] + a[3 * i + 2] * b[3 * j + 2];
  return c;
}

/// Cofactors: A⁻ᵀ = cofactor(A) / det A.
Matrix cofactor(const Matrix& a) {
  return {a[4] * a[8] - a[5] * a[7], a[5] * a[6] - a[3] * a[8], a[3] * a[7] - a[4] * a[6],
          a[2] * a[7] - a[1] * a[8], a[0] * a[8] - a[2] * a[6], a[1] * a[6] - a[0] * a[7],
          a[1] * a[5] - a[2] * a[4], a[2] * a[3] - a[0] * a[5], a[0] * a[4] - a[1] * a[3]};
}

/// The rotation of the polar decomposition by Higham's Newton iteration, R ← (R + R⁻ᵀ)/2.
Matrix rotation(const Matrix& F) {
  Matrix R = F;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const Matrix K = cofactor(R);
    const float inverse = 1.0F / (R[0] * K[0] + R[1] * K[1] + R[2] * K[2]);
    float change = 0.0F;
    for (std::size_t e = 0; e < 9; ++e) {
      const float next = 0.5F * (R[e] + inverse * K[e]);
      change = std::max(change, std::abs(next - R[e]));
      R[e] = next;
    }
    if (change < 1e-6F) break;
  }
  return R;
}

struct Stencil {
  std::array<int, 3> base;
  std::array<float, 3> offset;                 ///< particle minus base node, in cells
  std::array<std::array<float, 3>, 3> weight;  ///< [axis][node]
};

Stencil stencil(const std::array<float, 3>& x, float inverse_dx) {
  Stencil s{};
  for (std::size_t a = 0; a < 3; ++a) {
    const float cell = x[a] * inverse_dx;
    s.base[a] = static_cast<int>(cell - 0.5F);
    const float f = cell - static_cast<float>(s.base[a]);
    s.offset[a] = f;
    s.weight[a] = {0.5F * (1.5F - f) * (1.5F - f), 0.75F - (f - 1.0F) * (f - 1.0F),
                   0.5F * (f - 0.5F) * (f - 0.5F)};
  }
  return s;
}

}  // namespace

SerialMpm::SerialMpm(std::vector<Particle> particles, const Options& options)
    : particles_(std::move(particles)),
      options_(options),
      grid_(static_cast<std::size_t>(options.grid) * static_cast<std::size_t>(options.grid) *
            static_cast<std::size_t>(options.grid)) {}

std::size_t SerialMpm::node_index(int i, int j, int k) const {
  const int n = options_.grid;
  return static_cast<std::size_t>((i * n + j) * n + k);
}

void SerialMpm::scatter() {
  const float dx = options_.dx;
  const float inverse_dx = 1.0F / dx;
  for (Particle& p : particles_) {
    // F is advanced here, with the gradient that gather() left in C.
    Matrix advance;
    for (std::size_t e = 0; e < 9; ++e) {
      advance[e] = options_.dt * p.C[e] + (e % 4 == 0 ? 1.0F : 0.0F);
    }
    p.F = multiply(advance, p.F);
    const Matrix R = rotation(p.F);
    const Matrix K = cofactor(p.F);
    const float J = p.F[0] * K[0] + p.F[1] * K[1] + p.F[2] * K[2];
    Matrix difference;
    for (std::size_t e = 0; e < 9; ++e) difference[e] = 2.0F * options_.mu * (p.F[e] - R[e]);
    Matrix stress = multiply_transposed(difference, p.F);  // Kirchhoff: τ = P Fᵀ
    for (std::size_t e = 0; e < 9; e += 4) stress[e] += options_.lambda * (J - 1.0F) * J;

    const float scale = -options_.dt * p.volume * 4.0F * inverse_dx * inverse_dx;
    Matrix affine;
    for (std::size_t e = 0; e < 9; ++e) affine[e] = scale * stress[e] + p.mass * p.C[e];

    const Stencil s = stencil(p.x, inverse_dx);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < 3; ++k) {
          const float weight = s.weight[0][static_cast<std::size_t>(i)] *
                               s.weight[1][static_cast<std::size_t>(j)] *
                               s.weight[2][static_cast<std::size_t>(k)];
          const float rx = (static_cast<float>(i) - s.offset[0]) * dx;
          const float ry = (static_cast<float>(j) - s.offset[1]) * dx;
          const float rz = (static_cast<float>(k) - s.offset[2]) * dx;
          Node& node = grid_[node_index(s.base[0] + i, s.base[1] + j, s.base[2] + k)];
          for (std::size_t a = 0; a < 3; ++a) {
            node.v[a] += weight * (p.mass * p.v[a] + affine[3 * a] * rx + affine[3 * a + 1] * ry +
                                   affine[3 * a + 2] * rz);
          }
          node.mass += weight * p.mass;
        }
      }
    }
  }
}

void SerialMpm::update_grid() {
  const int n = options_.grid;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k) {
        Node& node = grid_[node_index(i, j, k)];
        if (node.mass <= 0.0F) continue;
        for (float& v : node.v) v /= node.mass;
        node.v[2] += options_.dt * options_.gravity;
        if (k < 3) node.v = {0.0F, 0.0F, 0.0F};  // sticky floor
      }
    }
  }
}

void SerialMpm::gather() {
  const float inverse_dx = 1.0F / options_.dx;
  for (Particle& p : particles_) {
    const Stencil s = stencil(p.x, inverse_dx);
    std::array<float, 3> v{};
    Matrix B{};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < 3; ++k) {
          const float weight = s.weight[0][static_cast<std::size_t>(i)] *
                               s.weight[1][static_cast<std::size_t>(j)] *
                               s.weight[2][static_cast<std::size_t>(k)];
          const float rx = static_cast<float>(i) - s.offset[0];
          const float ry = static_cast<float>(j) - s.offset[1];
          const float rz = static_cast<float>(k) - s.offset[2];
          const Node& node = grid_[node_index(s.base[0] + i, s.base[1] + j, s.base[2] + k)];
          for (std::size_t a = 0; a < 3; ++a) {
            const float wv = weight * node.v[a];
            v[a] += wv;
            B[3 * a] += wv * rx;
            B[3 * a + 1] += wv * ry;
            B[3 * a + 2] += wv * rz;
          }
        }
      }
    }
    p.v = v;
    for (std::size_t e = 0; e < 9; ++e) p.C[e] = 4.0F * inverse_dx * B[e];
    for (std::size_t a = 0; a < 3; ++a) p.x[a] += options_.dt * v[a];
  }
}

void SerialMpm::step() {
  std::fill(grid_.begin(), grid_.end(), Node{});
  scatter();
  update_grid();
  gather();
}

}  // namespace matterfit::bench
