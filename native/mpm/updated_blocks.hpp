// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "base/vec.hpp"
#include "mpm/kernels.hpp"
#include "mpm/layout.hpp"
#include "mpm/state_bytes.hpp"

namespace matterfit::mpm {

using Chunk = UpdatedChunk<float>;

/// The particles of one body in one block, by slab; lane l of slab s holds count[s][l] particles in
/// its first chunks.
struct BodyBlock {
  std::array<std::vector<Chunk>, kSlabs> slab;
  std::array<std::array<std::uint16_t, kLanes>, kSlabs> count{};

  void insert(const Crosser<float>& particle);
  /// Takes out the particles named by `leaving` (slab, chunk and lane ascending).
  void remove(const std::vector<Crosser<float>>& leaving);
  [[nodiscard]] std::size_t size() const;
};

/// One 4³ block of the sparse grid: particles, node velocities, and what its particles add to the
/// nodes it touches.
struct UpdatedBlock {
  Vec3i coordinates = Vec3i::Zero();
  std::array<std::uint32_t, 27> neighbours{};  ///< index 9(a+1)+3(b+1)+(c+1)
  std::vector<BodyBlock> bodies;
  bool occupied = false;    ///< has particles, or had some since the last tidy()
  std::vector<float> halo;  ///< [4][216], while occupied
  std::array<float, 3 * kBlockNodes> velocity{};     ///< of its own nodes [m/s]
  std::vector<std::vector<Crosser<float>>> leaving;  ///< per body, of this substep
  std::uint32_t leaving_to = 0;                      ///< bits of neighbours that get some
  double wake_time = -1e30;                          ///< of contact
  double sent_wake_time = -1e30;                     ///< wake_time as this substep's leavers left
  double penetration = 0.0;
  BlockExtremes<float> extremes{1.0F, 1.0F};
  float fastest = 0.0F;
};

/// The sparse set of blocks with their links. Indices are stable between calls of tidy().
class UpdatedBlocks {
 public:
  explicit UpdatedBlocks(std::size_t bodies) : bodies_(bodies) {}

  [[nodiscard]] std::size_t size() const { return blocks_.size(); }
  [[nodiscard]] UpdatedBlock& operator[](std::size_t i) { return *blocks_[i]; }
  [[nodiscard]] const UpdatedBlock& operator[](std::size_t i) const { return *blocks_[i]; }

  /// The block at these coordinates, made and linked if it is not there.
  std::uint32_t ensure(const Vec3i& coordinates);
  /// Makes a block ready for particles: its halo, and the blocks of all nodes they touch.
  void occupy(std::uint32_t block);
  /// Drops blocks that hold nothing and sorts the rest, so that neighbours are near in memory.
  void tidy();

  void save(ByteWriter& out) const;
  void load(ByteReader& in);

  [[nodiscard]] static std::size_t bytes_per_block() {
    return sizeof(UpdatedBlock) + 4 * kHaloNodes * 4;
  }

 private:
  struct Hash {
    std::size_t operator()(const std::array<int, 3>& c) const {
      std::size_t h = static_cast<std::size_t>(c[0]) * 73856093U;
      h ^= static_cast<std::size_t>(c[1]) * 19349663U;
      h ^= static_cast<std::size_t>(c[2]) * 83492791U;
      return h;
    }
  };
  void relink();

  std::size_t bodies_;
  std::vector<std::unique_ptr<UpdatedBlock>> blocks_;
  std::unordered_map<std::array<int, 3>, std::uint32_t, Hash> index_;
};

}  // namespace matterfit::mpm
