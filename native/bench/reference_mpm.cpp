// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/reference_mpm.hpp"

#include <array>
#include <cmath>

#include "base/error.hpp"

namespace matterfit::bench {
namespace {

constexpr int kSupport = 4;  // nodes of a cubic B-spline along an axis

}  // namespace

/// The 4³ nodes around a particle.
struct ReferenceMpm::Stencil {
  std::size_t first = 0;                               ///< index of the lowest node
  Vec3d offset;                                        ///< of that node [m]
  std::array<std::array<double, kSupport>, 3> weight;  ///< [axis][node]
};

ReferenceMpm::ReferenceMpm(const std::vector<Vec3d>& positions, const Vec3d& velocity,
                           const Vec3d& spin, const ReferenceMaterial& material,
                           const Options& options)
    : material_(material), options_(options), volume_(std::pow(0.5 * options.dx, 3)) {
  Vec3d centre = Vec3d::Zero();
  for (const Vec3d& x : positions) centre += x / static_cast<double>(positions.size());
  Mat3d turning;
  turning << 0, -spin.z(), spin.y(), spin.z(), 0, -spin.x(), -spin.y(), spin.x(), 0;
  const Vec3d half_kick(0, 0, -0.5 * options.dt * options.gravity);
  particles_.reserve(positions.size());
  for (const Vec3d& x : positions) {
    Particle p;
    p.x = x;
    p.v = velocity + turning * (x - centre) + half_kick;
    p.C = turning;
    particles_.push_back(p);
  }
}

void ReferenceMpm::fit_grid() {
  Vec3d low = particles_.front().x;
  Vec3d high = low;
  for (const Particle& p : particles_) {
    low = low.cwiseMin(p.x);
    high = high.cwiseMax(p.x);
  }
  low_ = (low / options_.dx).array().floor().cast<int>() - 1;
  size_ = (high / options_.dx).array().floor().cast<int>() + 3 - low_.array();
  grid_.assign(static_cast<std::size_t>(size_.x()) * static_cast<std::size_t>(size_.y()) *
                   static_cast<std::size_t>(size_.z()),
               Node::Zero());
}

ReferenceMpm::Stencil ReferenceMpm::stencil(const Vec3d& x) const {
  Stencil s;
  Eigen::Vector3i base;
  for (int axis = 0; axis < 3; ++axis) {
    const double cell = x[axis] / options_.dx;
    const double floor = std::floor(cell);
    const double f = cell - floor;
    const double g = 1.0 - f;
    base[axis] = static_cast<int>(floor) - 1 - low_[axis];
    s.offset[axis] = -(f + 1.0) * options_.dx;
    s.weight[static_cast<std::size_t>(axis)] = {
        g * g * g / 6.0, 0.5 * f * f * f - f * f + 2.0 / 3.0, 0.5 * g * g * g - g * g + 2.0 / 3.0,
        f * f * f / 6.0};
  }
  const Eigen::Index first = (Eigen::Index{base.x()} * size_.y() + base.y()) * size_.z() + base.z();
  s.first = static_cast<std::size_t>(first);
  return s;
}

void ReferenceMpm::scatter() {
  const double dx = options_.dx;
  const double mass = options_.density * volume_;
  const auto row = static_cast<std::size_t>(size_.z());
  const auto sheet = static_cast<std::size_t>(size_.y()) * row;
  for (Particle& p : particles_) {
    const Mat3d tau = advance(material_, p.C, options_.dt, p.state);
    const Mat3d affine = mass * p.C - (options_.dt * volume_ * 3.0 / (dx * dx)) * tau;
    const Stencil s = stencil(p.x);
    const auto column = [&](int axis) {
      return Node(affine(0, axis), affine(1, axis), affine(2, axis), 0.0);
    };
    const Node along_x = column(0) * dx;
    const Node along_y = column(1) * dx;
    const Node along_z = column(2) * dx;
    const Node at_first = Node(mass * p.v.x(), mass * p.v.y(), mass * p.v.z(), mass) +
                          column(0) * s.offset.x() + column(1) * s.offset.y() +
                          column(2) * s.offset.z();
    for (std::size_t i = 0; i < kSupport; ++i) {
      for (std::size_t j = 0; j < kSupport; ++j) {
        const double weight = s.weight[0][i] * s.weight[1][j];
        Node value = at_first + static_cast<double>(i) * along_x + static_cast<double>(j) * along_y;
        Node* nodes = &grid_[s.first + i * sheet + j * row];
        for (std::size_t k = 0; k < kSupport; ++k) {
          nodes[k] += (weight * s.weight[2][k]) * value;
          value += along_z;
        }
      }
    }
  }
}

void ReferenceMpm::update_grid() {
  std::size_t index = 0;
  for (int column = 0; column < size_.x() * size_.y(); ++column) {
    for (int k = 0; k < size_.z(); ++k, ++index) {
      Node& node = grid_[index];
      if (node[3] <= 0.0) continue;
      node.head<3>() /= node[3];
      node[2] += options_.dt * options_.gravity;
      if (options_.ground && low_.z() + k <= 0) node.head<3>() = 0.0;
    }
  }
}

void ReferenceMpm::gather() {
  const double dx = options_.dx;
  const double inverse_inertia = 3.0 / (dx * dx);
  const auto row = static_cast<std::size_t>(size_.z());
  const auto sheet = static_cast<std::size_t>(size_.y()) * row;
  for (Particle& p : particles_) {
    const Stencil s = stencil(p.x);
    Node velocity = Node::Zero();
    Node moment_x = Node::Zero();
    Node moment_y = Node::Zero();
    Node moment_z = Node::Zero();
    for (std::size_t i = 0; i < kSupport; ++i) {
      Node sheet_sum = Node::Zero();
      for (std::size_t j = 0; j < kSupport; ++j) {
        const double weight = s.weight[0][i] * s.weight[1][j];
        const Node* nodes = &grid_[s.first + i * sheet + j * row];
        Node sum = Node::Zero();
        for (std::size_t k = 0; k < kSupport; ++k) {
          const Node part = (weight * s.weight[2][k]) * nodes[k];
          sum += part;
          moment_z += part * (s.offset.z() + static_cast<double>(k) * dx);
        }
        moment_y += sum * (s.offset.y() + static_cast<double>(j) * dx);
        sheet_sum += sum;
      }
      moment_x += sheet_sum * (s.offset.x() + static_cast<double>(i) * dx);
      velocity += sheet_sum;
    }
    p.v = velocity.head<3>();
    p.C.col(0) = inverse_inertia * moment_x.head<3>();
    p.C.col(1) = inverse_inertia * moment_y.head<3>();
    p.C.col(2) = inverse_inertia * moment_z.head<3>();
    if (!(p.v.cwiseAbs().maxCoeff() * options_.dt < dx)) {
      throw_compute("A particle moved farther than a cell: the fixed substep is too long.");
    }
    p.x += options_.dt * p.v;
  }
}

void ReferenceMpm::step() {
  fit_grid();
  scatter();
  update_grid();
  gather();
}

}  // namespace matterfit::bench
