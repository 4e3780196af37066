// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "mpm/updated_adjoint.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

/// Calls visit(cotangent of momentum, of mass, i, j, k) for the nodes of the place's cell. `nodes`
/// of the blocks of `topology`, as UpdatedCotangents::nodes.
template <class S, class Visit>
void for_each_cotangent(const UpdatedTopology& topology, const std::vector<S>& nodes,
                        const UpdatedPlace<S>& place, const Visit& visit) {
  place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t i, std::size_t j,
                          std::size_t k) {
    const std::size_t block = topology.neighbours[place.block][neighbour_of_node(x, y, z)];
    const S* node = nodes.data() + block * 4 * kBlockNodes + node_index(x % 4, y % 4, z % 4);
    visit(Vec3d(static_cast<double>(node[0]), static_cast<double>(node[kBlockNodes]),
                static_cast<double>(node[2 * kBlockNodes])),
          static_cast<double>(node[3 * kBlockNodes]), i, j, k);
  });
}

/// Adds to three numbers of an UpdatedParticleBar.
template <class S>
void add_to(const Vec3d& value, std::array<S, 3>& sum) {
  for (std::size_t c = 0; c < 3; ++c) sum[c] += static_cast<S>(value[static_cast<int>(c)]);
}

/// Cotangents of the grid at a place: sums over its nodes, and how they change with the place.
struct GridSums {
  Vec3d momentum = Vec3d::Zero();
  double mass = 0.0;
  Mat3d momentum_by = Mat3d::Zero();  ///< ∂momentum/∂x [1/m]
  Vec3d mass_by = Vec3d::Zero();
};

/// The grid after a substep with the cotangents of its nodes, as the adjoints of what acts on
/// single particles there see it (UpdatedLoad::act_adjoint).
template <class S>
class UpdatedBack {
 public:
  /// `nodes`: per block of record.after [4][64], cotangents of momentum and mass; `velocity`: of
  /// the nodes in the substep, per block of record.before [3][64]. Both are borrowed.
  UpdatedBack(const UpdatedRecord<S>& record, const std::vector<S>& nodes, const S* velocity,
              double dx)
      : record_(record), nodes_(nodes), velocity_(velocity), dx_(dx) {}

  [[nodiscard]] double dx() const { return dx_; }
  [[nodiscard]] double dt() const { return record_.dt; }
  /// At which loads acted [s].
  [[nodiscard]] double time() const { return record_.time + record_.dt; }
  [[nodiscard]] Vec3d position(const UpdatedPlace<S>& place) const {
    const Vec3d origin =
        record_.after->coordinates[place.block].template cast<double>() * (4 * dx_);
    return place.position(origin, dx_);
  }

  template <class Visit>
  void for_each_cotangent(const UpdatedPlace<S>& place, const Visit& visit) const {
    mpm::for_each_cotangent(*record_.after, nodes_, place, visit);
  }
  /// At the nodes of the place's cell, with the weights of `f`.
  [[nodiscard]] GridSums sums(const UpdatedPlace<S>& place, const Vec3d& f) const;

  /// Σ v_I ∇w_I.
  [[nodiscard]] Mat3d velocity_gradient(const UpdatedPlace<S>& place, const PointStencil& s) const;
  /// From the cotangent of velocity_gradient() to those of the node velocities, which are made if
  /// there are none yet, and of the place.
  void velocity_gradient_adjoint(const UpdatedPlace<S>& place, const PointStencil& s,
                                 const Mat3d& gradient_bar, std::vector<double>& velocity_bar,
                                 Vec3d& x_bar) const;

 private:
  /// Calls visit(first component's place in a velocity field, i, j, k) for the nodes that the grid
  /// had in the substep; the others were at rest.
  template <class Visit>
  void for_each_velocity(const UpdatedPlace<S>& place, const Visit& visit) const {
    place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t i,
                            std::size_t j, std::size_t k) {
      const std::size_t block = record_.after->neighbours[place.block][neighbour_of_node(x, y, z)];
      if (block >= record_.before->coordinates.size()) return;
      visit(block * 3 * kBlockNodes + node_index(x % 4, y % 4, z % 4), i, j, k);
    });
  }
  [[nodiscard]] Vec3d node_velocity(std::size_t at) const {
    return {static_cast<double>(velocity_[at]), static_cast<double>(velocity_[at + kBlockNodes]),
            static_cast<double>(velocity_[at + 2 * kBlockNodes])};
  }

  const UpdatedRecord<S>& record_;
  const std::vector<S>& nodes_;
  const S* velocity_;
  double dx_;
};

extern template class UpdatedBack<float>;
extern template class UpdatedBack<double>;

}  // namespace matterfit::mpm
