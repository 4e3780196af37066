// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "mpm/kernels.hpp"
#include "mpm/updated_blocks.hpp"
#include "mpm/updated_member.hpp"
#include "mpm/updated_place.hpp"

namespace matterfit::mpm {

/// Which blocks a sparse grid has.
struct UpdatedTopology {
  std::vector<Vec3i> coordinates;
  std::vector<std::array<std::uint32_t, 27>> neighbours;  ///< as UpdatedBlock's
};

/// What a load (updated_load.hpp) did to single particles in one substep, as its adjoint needs it.
class UpdatedActs {
 public:
  UpdatedActs() = default;
  virtual ~UpdatedActs() = default;
  UpdatedActs(const UpdatedActs&) = delete;
  UpdatedActs& operator=(const UpdatedActs&) = delete;
  /// Adds those of the same load in another block at the end.
  virtual void append(const UpdatedActs& other) = 0;
  [[nodiscard]] virtual std::size_t bytes() const = 0;
};
/// Null: nothing.
using UpdatedActsPtr = std::unique_ptr<UpdatedActs>;

/// Those of a load that keeps an Act for each.
template <class Act>
class UpdatedActsOf final : public UpdatedActs {
 public:
  void append(const UpdatedActs& other) override {
    const std::vector<Act>& more = of(other);
    list_.insert(list_.end(), more.begin(), more.end());
  }
  [[nodiscard]] std::size_t bytes() const override { return list_.size() * sizeof(Act); }

  /// `acts` must be of this kind, or null; then they are made.
  static void add(UpdatedActsPtr& acts, const Act& act) {
    if (!acts) acts = std::make_unique<UpdatedActsOf>();
    static_cast<UpdatedActsOf&>(*acts).list_.push_back(act);
  }
  [[nodiscard]] static const std::vector<Act>& of(const UpdatedActs& acts) {
    return static_cast<const UpdatedActsOf&>(acts).list_;
  }

 private:
  std::vector<Act> list_;
};

/// What is kept of an UpdatedChunk: its attributes up to the velocity, which the grid has.
template <class S>
struct KeptChunk {
  static constexpr std::size_t kAttributes = UpdatedChunk<S>::kVelocity;
  alignas(64) S a[kAttributes][kLanes];
  std::uint32_t id[kLanes];
};

/// The velocities of a chunk's particles [m/s].
template <class S>
struct KeptVelocity {
  S v[3][kLanes];
};

/// Values that are not set when they are made: each thread touches its own first.
template <class Value>
class RawArray {
 public:
  void resize(std::size_t size) {
    values_ = std::make_unique_for_overwrite<Value[]>(size);
    size_ = size;
  }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] Value* data() { return values_.get(); }
  [[nodiscard]] const Value* data() const { return values_.get(); }
  [[nodiscard]] const Value& operator[](std::size_t i) const { return values_[i]; }
  [[nodiscard]] const Value* begin() const { return data(); }
  [[nodiscard]] const Value* end() const { return data() + size_; }

 private:
  std::unique_ptr<Value[]> values_;
  std::size_t size_ = 0;
};

/// What the adjoint needs of one substep (updated_adjoint.hpp): the particles and the grid before
/// it, in storage order, and what loads did after it. Some 75 bytes a particle in float where cells
/// are evenly filled, and 24 more for each Maxwell branch.
template <class S>
struct UpdatedRecord {
  double time = 0.0;  ///< of the state before [s]
  double dt = 0.0;
  double kick = 0.0;  ///< of gravity [s]
  Vec3d gravity = Vec3d::Zero();
  std::shared_ptr<const UpdatedTopology> before;
  std::shared_ptr<const UpdatedTopology> after;  ///< more blocks at the end
  std::vector<S> node_mass;                      ///< per block [64]
  std::vector<S> node_velocity;                  ///< per block [3][64], before node-wise contact
  /// First of `chunks` of each block, body and slab, in this order, and the end.
  std::vector<std::uint32_t> slab_chunks;
  RawArray<KeptChunk<S>> chunks;
  RawArray<KeptVelocity<S>> velocities;  ///< as `chunks`; empty where no load asks
  std::vector<std::vector<S>> maxwell;   ///< per body, as UpdatedView::maxwell
  std::vector<UpdatedActsPtr> acts;      ///< after it, of each of the loads' list

  /// Those of one more block.
  void add_acts(std::vector<UpdatedActsPtr>&& of_block);
  /// Bytes of it [B], without the topologies, which substeps share.
  [[nodiscard]] std::size_t bytes() const;
};

template <class S>
[[nodiscard]] std::shared_ptr<const UpdatedTopology> take_topology(const UpdatedBlocks<S>& blocks);
/// The particles before a substep; `velocities`: theirs as well.
template <class S>
void keep_particles(Arena& arena, const UpdatedBlocks<S>& blocks,
                    const std::vector<UpdatedMember<S>>& members, bool velocities,
                    UpdatedRecord<S>& record);

extern template struct UpdatedRecord<float>;
extern template struct UpdatedRecord<double>;

}  // namespace matterfit::mpm
