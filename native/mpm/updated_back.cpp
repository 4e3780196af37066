// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_back.hpp"

namespace matterfit::mpm {

template <class S>
GridSums UpdatedBack<S>::sums(const UpdatedPlace<S>& place, const Vec3d& f) const {
  GridSums out;
  const PointStencil s(f, dx_);
  for_each_cotangent(
      place, [&](const Vec3d& momentum, double mass, std::size_t i, std::size_t j, std::size_t k) {
        const double w = s.weight(i, j, k);
        const Vec3d g = s.gradient(i, j, k);
        out.momentum += w * momentum;
        out.momentum_by += momentum * g.transpose();
        out.mass += w * mass;
        out.mass_by += mass * g;
      });
  return out;
}

template <class S>
Mat3d UpdatedBack<S>::velocity_gradient(const UpdatedPlace<S>& place, const PointStencil& s) const {
  Mat3d gradient = Mat3d::Zero();
  for_each_velocity(place, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    gradient += node_velocity(node) * s.gradient(i, j, k).transpose();
  });
  return gradient;
}

template <class S>
void UpdatedBack<S>::velocity_gradient_adjoint(const UpdatedPlace<S>& place, const PointStencil& s,
                                               const Mat3d& gradient_bar,
                                               std::vector<double>& velocity_bar,
                                               Vec3d& x_bar) const {
  if (velocity_bar.empty()) {
    velocity_bar.assign(record_.before->coordinates.size() * 3 * kBlockNodes, 0.0);
  }
  for_each_velocity(place, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    const Vec3d bar = gradient_bar * s.gradient(i, j, k);
    for (std::size_t a = 0; a < 3; ++a) {
      velocity_bar[node + a * kBlockNodes] += bar[static_cast<int>(a)];
    }
    x_bar += s.curvature(i, j, k, dx_) * (gradient_bar.transpose() * node_velocity(node));
  });
}

template class UpdatedBack<float>;
template class UpdatedBack<double>;

}  // namespace matterfit::mpm
