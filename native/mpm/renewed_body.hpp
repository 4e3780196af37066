// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "mpm/renewed_kernels.hpp"
#include "mpm/renewed_store.hpp"
#include "mpm/scene.hpp"
#include "mpm/state_bytes.hpp"

namespace matterfit::mpm {

/// One body of the renewed formulation: its particles between two renewals, and how they find
/// their places in the next reference.
template <class S>
class RenewedBody {
 public:
  /// Throws Error(kInput) for pins, attached masses and a particle too far from the origin.
  /// `common`: the velocity that those of particles are given relative to.
  RenewedBody(const Body& body, std::size_t index, double dx, const Vec3d& common);

  [[nodiscard]] std::size_t index() const { return index_; }  ///< into scene.bodies
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const material::Material& material() const { return material_; }
  [[nodiscard]] const material::LawConstants<S>& law() const { return law_; }
  [[nodiscard]] double density() const { return density_; }
  [[nodiscard]] std::size_t particles() const { return particles_; }
  [[nodiscard]] std::size_t blocks() const { return store_.coordinates.size(); }
  [[nodiscard]] const std::vector<Vec3i>& coordinates() const { return store_.coordinates; }
  [[nodiscard]] const RenewedStore<S>& store() const { return store_; }
  /// Sticks to surfaces by its particles' faces, not their centres.
  [[nodiscard]] bool wets() const { return material_.traits().wets; }
  /// Only J of the elastic deformation is history.
  [[nodiscard]] bool is_fluid() const { return material_.traits().fluid; }

  /// What kernels see; `nodes` as RenewedGrid::nodes_of.
  [[nodiscard]] RenewedView<S> view(const std::vector<double>& displacement,
                                    const std::vector<double>& velocity,
                                    const std::vector<std::uint32_t>& nodes);
  /// RenewedStore::for_each.
  template <class Visit>
  void for_each(std::size_t b, const Visit& visit) const {
    store_.for_each(b, visit);
  }
  [[nodiscard]] double volume(std::size_t slot) const { return store_.volume(slot); }
  /// Elastic F at the reference.
  [[nodiscard]] Mat3d elastic(std::size_t slot) const {
    return renewed_elastic(store_.history, is_fluid(), slot);
  }
  [[nodiscard]] double plastic_strain(std::size_t slot) const;

  /// After `leave` of every block: particles take their places among the blocks they have come to.
  void arrange(Arena& arena, double dx);
  [[nodiscard]] S* halo(std::size_t block) { return halo_.data() + block * 4 * kHaloNodes; }
  [[nodiscard]] const S* halo(std::size_t block) const {
    return halo_.data() + block * 4 * kHaloNodes;
  }
  [[nodiscard]] const std::vector<BlockExtremes<S>>& extremes() const { return extremes_; }
  [[nodiscard]] const std::vector<RenewedDeparture<S>>& departure() const { return departure_; }

  /// Back to another state: of another reference, or with other histories at this one.
  void restore(const RenewedStore<S>& reference, const std::vector<S>& history,
               const std::vector<S>& maxwell);

  void save(ByteWriter& out) const;
  void load(ByteReader& in);

 private:
  /// Where a particle goes.
  struct Arrival {
    Vec3i block;
    std::uint32_t cell;  ///< of the block: slab · 16 + lane
    S f[3];
  };
  void start(const Body& body, double dx, const Vec3d& common);
  /// `arrivals` of each slot that has a particle in store_.
  void settle(Arena& arena, const std::vector<Arrival>& arrivals);
  void make_room();
  void make_blocks();

  std::size_t index_;
  std::string name_;
  material::Material material_;
  material::LawConstants<S> law_;
  double density_;
  std::size_t particles_;
  RenewedStore<S> store_;
  RenewedStore<S> next_;    ///< memory of the reference before
  std::vector<S> carried_;  ///< chunks × [RenewedCarried::kAttributes][16]
  std::vector<S> next_carried_;
  std::vector<double> moved_;  ///< blocks × [3]
  std::vector<S> halo_;        ///< blocks × [4][216]
  std::vector<BlockExtremes<S>> extremes_;
  std::vector<RenewedDeparture<S>> departure_;
};

extern template class RenewedBody<float>;
extern template class RenewedBody<double>;

}  // namespace matterfit::mpm
