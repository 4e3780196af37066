// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_grid.hpp"

namespace matterfit::mpm {

template <class S>
void UpdatedGrid<S>::add_momentum(const UpdatedPlace<S>& place,
                                  const Eigen::Matrix<S, 3, 1>& momentum, S mass,
                                  const Vec3d& offset) {
  S o[3];
  for (int axis = 0; axis < 3; ++axis) o[axis] = static_cast<S>(offset[axis] / dx);
  const OffsetPlace<S> at(place, o);
  S w[3][3];
  for (std::size_t axis = 0; axis < 3; ++axis) quadratic_weights(at.f[axis], w[axis]);
  S* halo = blocks[place.block].halo.data();
  place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t i, std::size_t j,
                          std::size_t k) {
    const std::size_t node = halo_index(x, y, z);
    const S weight = w[0][i] * w[1][j] * w[2][k];
    for (std::size_t c = 0; c < 3; ++c) {
      halo[c * kHaloNodes + node] += weight * momentum[static_cast<int>(c)];
    }
    halo[3 * kHaloNodes + node] += weight * mass;
  });
}

template <class S>
void UpdatedGrid<S>::add_affine_momentum(const UpdatedPlace<S>& place, double mass,
                                         const Vec3d& velocity, const Mat3d& gradient) {
  const Vec3d f = place.fraction();
  const PointStencil s(f, dx);
  S* halo = blocks[place.block].halo.data();
  place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t i, std::size_t j,
                          std::size_t k) {
    const std::size_t node = halo_index(x, y, z);
    const double share = mass * s.weight(i, j, k);
    const Vec3d momentum = share * (velocity + gradient * (dx * (stencil_node(i, j, k) - f)));
    for (std::size_t c = 0; c < 3; ++c) {
      halo[c * kHaloNodes + node] += static_cast<S>(momentum[static_cast<int>(c)]);
    }
    halo[3 * kHaloNodes + node] += static_cast<S>(share);
  });
}

template <class S>
void UpdatedGrid<S>::add_gradient_momentum(const UpdatedPlace<S>& place, const Mat3d& m) {
  const PointStencil s(place.fraction(), dx);
  S* halo = blocks[place.block].halo.data();
  place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t i, std::size_t j,
                          std::size_t k) {
    const std::size_t node = halo_index(x, y, z);
    const Vec3d momentum = m * s.gradient(i, j, k);
    for (std::size_t c = 0; c < 3; ++c) {
      halo[c * kHaloNodes + node] += static_cast<S>(momentum[static_cast<int>(c)]);
    }
  });
}

template <class S>
Mat3d UpdatedGrid<S>::velocity_gradient(const UpdatedPlace<S>& place) const {
  const PointStencil s(place.fraction(), dx);
  Mat3d gradient = Mat3d::Zero();
  place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t i, std::size_t j,
                          std::size_t k) {
    const std::uint32_t at = blocks[place.block].neighbours[neighbour_of_node(x, y, z)];
    const S* v = blocks[at].velocity.data() + node_index(x % 4, y % 4, z % 4);
    const Vec3d g = s.gradient(i, j, k);
    for (std::size_t c = 0; c < 3; ++c) {
      gradient.row(static_cast<int>(c)) += static_cast<double>(v[c * kBlockNodes]) * g.transpose();
    }
  });
  return gradient;
}

template struct UpdatedGrid<float>;
template struct UpdatedGrid<double>;

}  // namespace matterfit::mpm
