// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "base/vec.hpp"
#include "mpm/cell_hash.hpp"
#include "mpm/kernels.hpp"
#include "mpm/layout.hpp"
#include "mpm/state_bytes.hpp"

namespace matterfit::mpm {

/// The particles of one body in one block, by slab; lane l of slab s holds count[s][l] particles in
/// its first chunks.
template <class S>
struct BodyBlock {
  std::array<std::vector<UpdatedChunk<S>>, kSlabs> slab;
  std::array<std::array<std::uint16_t, kLanes>, kSlabs> count{};

  void insert(const Crosser<S>& particle);
  /// Takes out the particles named by `leaving` (slab, chunk and lane ascending).
  void remove(const std::vector<Crosser<S>>& leaving);
  [[nodiscard]] std::size_t size() const;

  /// Calls visit(slab, chunk, lane) for each particle, in storage order.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (std::size_t s = 0; s < kSlabs; ++s) {
      for (std::size_t l = 0; l < kLanes; ++l) {
        for (std::size_t k = 0; k < count[s][l]; ++k) visit(s, slab[s][k], l);
      }
    }
  }
};

/// One 4³ block of the sparse grid: particles, node velocities, and what its particles add to the
/// nodes it touches.
template <class S>
struct UpdatedBlock {
  Vec3i coordinates = Vec3i::Zero();
  std::array<std::uint32_t, 27> neighbours{};  ///< index 9(a+1)+3(b+1)+(c+1)
  std::vector<BodyBlock<S>> bodies;
  bool occupied = false;                      ///< has particles, or had some since the last tidy()
  std::vector<S> halo;                        ///< [4][216], while occupied
  std::array<S, 3 * kBlockNodes> velocity{};  ///< of its own nodes [m/s]
  std::vector<std::vector<Crosser<S>>> leaving;  ///< per body, of this substep
  std::uint32_t leaving_to = 0;                  ///< bits of neighbours that get some
  double wake_time = -1e30;                      ///< of contact
  double sent_wake_time = -1e30;                 ///< wake_time as this substep's leavers left
  double penetration = 0.0;
  BlockExtremes<S> extremes{S(1), S(1)};
  S fastest = S(0);
};

/// The sparse set of blocks with their links. Indices are stable between calls of tidy().
template <class S>
class UpdatedBlocks {
 public:
  explicit UpdatedBlocks(std::size_t bodies) : bodies_(bodies) {}

  [[nodiscard]] std::size_t size() const { return blocks_.size(); }
  [[nodiscard]] UpdatedBlock<S>& operator[](std::size_t i) { return *blocks_[i]; }
  [[nodiscard]] const UpdatedBlock<S>& operator[](std::size_t i) const { return *blocks_[i]; }

  /// World position of a block's node (0, 0, 0), for the grid's spacing `dx`.
  [[nodiscard]] Vec3d origin(std::size_t i, double dx) const {
    return blocks_[i]->coordinates.template cast<double>() * (4.0 * dx);
  }
  /// The block at these coordinates, made and linked if it is not there.
  std::uint32_t ensure(const Vec3i& coordinates);
  /// Makes a block ready for particles: its halo, and the blocks of all nodes they touch.
  void occupy(std::uint32_t block);
  /// Drops blocks that hold nothing and sorts the rest, so that neighbours are near in memory.
  void tidy();

  void save(ByteWriter& out) const;
  void load(ByteReader& in);

  [[nodiscard]] static std::size_t bytes_per_block() {
    return sizeof(UpdatedBlock<S>) + 4 * kHaloNodes * sizeof(S);
  }

 private:
  void relink();

  std::size_t bodies_;
  std::vector<std::unique_ptr<UpdatedBlock<S>>> blocks_;
  std::unordered_map<std::array<int, 3>, std::uint32_t, CellHash> index_;
};

extern template struct BodyBlock<float>;
extern template struct BodyBlock<double>;
extern template class UpdatedBlocks<float>;
extern template class UpdatedBlocks<double>;

}  // namespace matterfit::mpm
