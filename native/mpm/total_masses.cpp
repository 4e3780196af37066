// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_masses.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

namespace matterfit::mpm {

TotalMasses::TotalMasses(const Body& body, const TotalGrid& grid) : grid_(grid) {
  for (const AttachedMass& attached : body.masses) {
    masses_.push_back(
        {grid.point_weights(grid.to_local(attached.position)), attached.mass, attached.attach});
  }
  couple();
}

std::vector<std::uint32_t> TotalMasses::nodes() const {
  std::vector<std::uint32_t> nodes;
  for (const Mass& mass : masses_) {
    nodes.insert(nodes.end(), mass.weights.nodes.begin(), mass.weights.nodes.end());
  }
  return nodes;
}

void TotalMasses::couple() {
  std::stable_sort(masses_.begin(), masses_.end(),
                   [](const Mass& a, const Mass& b) { return a.attach < b.attach; });
  NodeList list;
  list.add(nodes());
  // Rows of W M^(−½).
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(masses_.size()),
                                               static_cast<Eigen::Index>(list.size()));
  for (std::size_t k = 0; k < masses_.size(); ++k) {
    const NodeWeights& w = masses_[k].weights;
    for (std::size_t n = 0; n < w.nodes.size(); ++n) {
      const auto at = static_cast<Eigen::Index>(list.index(w.nodes[n]));
      rows(static_cast<Eigen::Index>(k), at) +=
          w.weights[n] * std::sqrt(grid_.inverse_mass()[w.nodes[n]]);
    }
  }
  for (std::size_t k = 0; k < masses_.size(); ++k) {
    if (k + 1 < masses_.size() && masses_[k + 1].attach == masses_[k].attach) continue;
    const auto count = static_cast<Eigen::Index>(k + 1);
    Group group;
    group.count = k + 1;
    group.from = masses_[k].attach;
    group.compliance = rows.topRows(count) * rows.topRows(count).transpose();
    Eigen::MatrixXd system = group.compliance;
    for (Eigen::Index j = 0; j < count; ++j)
      system.col(j) *= masses_[static_cast<std::size_t>(j)].mass;
    system.diagonal().array() += 1.0;
    group.inverse = system.inverse();
    groups_.push_back(std::move(group));
  }
}

const TotalMasses::Group* TotalMasses::group(double time) const {
  const Group* group = nullptr;
  for (const Group& g : groups_) {
    if (time + 1e-12 >= g.from) group = &g;
  }
  return group;
}

// a_c − g = (I + W M⁻¹ Wᵀ m)⁻¹ (W a − g), and the body feels m (g − a_c) at each.
void TotalMasses::push(const NodeMoment& moment, NodeMotion& motion) const {
  const Group* group = this->group(moment.time);
  if (group == nullptr) return;
  std::vector<Vec3d>& a = motion.acceleration;
  Eigen::MatrixX3d relative(static_cast<Eigen::Index>(group->count), 3);
  for (std::size_t k = 0; k < group->count; ++k) {
    const NodeWeights& w = masses_[k].weights;
    Vec3d free = -moment.gravity;
    for (std::size_t n = 0; n < w.nodes.size(); ++n) {
      free += w.weights[n] * a[motion.list.index(w.nodes[n])];
    }
    relative.row(static_cast<Eigen::Index>(k)) = free.transpose();
  }
  const Eigen::MatrixX3d solved = group->inverse * relative;
  for (std::size_t k = 0; k < group->count; ++k) {
    const Vec3d force = -masses_[k].mass * solved.row(static_cast<Eigen::Index>(k)).transpose();
    const NodeWeights& w = masses_[k].weights;
    for (std::size_t n = 0; n < w.nodes.size(); ++n) {
      a[motion.list.index(w.nodes[n])] += w.weights[n] * grid_.inverse_mass()[w.nodes[n]] * force;
    }
  }
}

void TotalMasses::push_adjoint(const NodeMoment& moment, const std::vector<Vec3d>& acceleration,
                               NodeMotionBar& bar) const {
  const Group* group = this->group(moment.time);
  if (group == nullptr) return;
  const auto rows = static_cast<Eigen::Index>(group->count);
  Eigen::MatrixX3d relative(rows, 3);
  Eigen::MatrixX3d solved_bar(rows, 3);
  Eigen::MatrixX3d force_bar(rows, 3);
  for (std::size_t k = 0; k < group->count; ++k) {
    const NodeWeights& w = masses_[k].weights;
    Vec3d free = -moment.gravity;
    Vec3d sum = Vec3d::Zero();
    for (std::size_t n = 0; n < w.nodes.size(); ++n) {
      const std::size_t i = bar.list.index(w.nodes[n]);
      free += w.weights[n] * acceleration[i];
      sum += w.weights[n] * grid_.inverse_mass()[w.nodes[n]] * bar.acceleration[i];
    }
    const auto row = static_cast<Eigen::Index>(k);
    relative.row(row) = free.transpose();
    force_bar.row(row) = sum.transpose();
    solved_bar.row(row) = -masses_[k].mass * sum.transpose();
  }
  Eigen::MatrixX3d weighted = group->inverse * relative;  // m solved
  for (std::size_t k = 0; k < group->count; ++k) {
    weighted.row(static_cast<Eigen::Index>(k)) *= masses_[k].mass;
  }
  const Eigen::MatrixX3d relative_bar = group->inverse.transpose() * solved_bar;
  // M⁻¹ and the compliance W M⁻¹ Wᵀ go with the inverse of the density.
  bar.log_density += (force_bar.array() * weighted.array()).sum() +
                     (relative_bar.array() * (group->compliance * weighted).array()).sum();
  for (std::size_t k = 0; k < group->count; ++k) {
    const NodeWeights& w = masses_[k].weights;
    const Vec3d back = relative_bar.row(static_cast<Eigen::Index>(k)).transpose();
    bar.gravity -= back;
    for (std::size_t n = 0; n < w.nodes.size(); ++n) {
      bar.acceleration[bar.list.index(w.nodes[n])] += w.weights[n] * back;
    }
  }
}

}  // namespace matterfit::mpm
