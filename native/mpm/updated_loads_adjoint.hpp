// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "mpm/updated_adjoint.hpp"

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

/// Adjoints of what acts on single particles after a substep: contact with colliders
/// (UpdatedContact), pins (apply_updated_pins) and attached masses (apply_attached_masses).
template <class S>
class UpdatedLoadsAdjoint {
 public:
  UpdatedLoadsAdjoint(const Scene& scene, const std::vector<UpdatedMember<S>>& members,
                      std::vector<shape::ColliderPtr> colliders);

  /// Adds to the cotangents of particles, rest places, densities, and of the n-th collider to
  /// `colliders`. `nodes`: per block of record.after [4][64], cotangents of momentum and mass.
  /// `velocity` are the node velocities of the substep, per block of record.before [3][64], and
  /// `velocity_bar` gets their cotangents, if any: else it stays empty.
  void back(Arena& arena, const UpdatedRecord<S>& record, const std::vector<S>& nodes,
            const S* velocity, std::vector<UpdatedBodyCotangents<S>>& bodies,
            shape::ColliderCotangents* colliders, std::vector<double>& velocity_bar) const;

 private:
  struct Substep;
  /// What many touches add to.
  struct Sums {
    std::vector<shape::ColliderCotangents> colliders;
    std::vector<double> log_density;  ///< per member
  };
  void touch(const Substep& at, const UpdatedTouch<S>& touch, UpdatedBodyCotangents<S>& body,
             Sums& sums, std::vector<double>& velocity_bar) const;
  void hold(const Substep& at, const UpdatedHold<S>& hold, UpdatedBodyCotangents<S>& body) const;
  void carry(const Substep& at, const UpdatedCarry<S>& carry, UpdatedParticleBar<S>& bar,
             std::vector<double>& velocity_bar) const;

  double dx_;
  const std::vector<UpdatedMember<S>>& members_;
  std::vector<shape::ColliderPtr> colliders_;
};

extern template class UpdatedLoadsAdjoint<float>;
extern template class UpdatedLoadsAdjoint<double>;

}  // namespace matterfit::mpm
