// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/vec.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/renewed_body.hpp"
#include "mpm/renewed_grid.hpp"
#include "mpm/renewed_state.hpp"
#include "mpm/scene.hpp"
#include "mpm/state_bytes.hpp"

namespace matterfit::mpm {

/// A force at a particle of a block, shared among the nodes of its cell.
template <class S>
struct RenewedLoad {
  UpdatedPlace<S> place;
  Vec3d force;                   ///< [N]
  Vec3d offset = Vec3d::Zero();  ///< where it acts, at the reference [cells]
};

/// Contact of one renewed body's particles with colliders. Particles that cannot reach one are not
/// looked at until they could.
template <class S>
class RenewedContact {
 public:
  RenewedContact(const Body& body, const Scene& scene, std::vector<shape::ColliderPtr> colliders);

  [[nodiscard]] bool any() const { return !colliders_.empty(); }
  [[nodiscard]] const std::vector<ContactLaw>& laws() const { return laws_; }
  /// At the start of a frame, and where the reference is another: every block looks again.
  void wake(std::size_t blocks);
  void begin_frame(double frame_seconds, double acceleration);
  /// Forces of block b at `time`, displacements and velocities those of the nodes. `touches` gets
  /// what a way back needs, but RenewedTouch::member; null: nothing.
  void apply(const RenewedBody<S>& body, std::size_t b, const std::uint32_t* nodes,
             const std::vector<double>& displacement, const std::vector<double>& velocity,
             double dx, double time, double dt, std::vector<RenewedLoad<S>>& loads,
             std::vector<RenewedTouch>* touches);
  [[nodiscard]] double max_penetration() const;

  /// Memories of the particles that have one, ascending.
  [[nodiscard]] ContactMemories memories() const;
  void restore(const ContactMemories& memories);

  void save(ByteWriter& out) const { out.put(memory_); }
  void load(ByteReader& in) { in.get_same_size(memory_); }

 private:
  struct Near {
    std::uint32_t slot;
    UpdatedPlace<S> place;
  };
  struct BlockNear {
    double until = -1e30;  ///< nobody else is in reach before [s]
    double penetration = 0.0;
    std::vector<Near> particles;
  };
  struct Field;
  void look(const RenewedBody<S>& body, std::size_t b, const Field& field, double dx, double time,
            BlockNear& near) const;

  std::vector<shape::ColliderPtr> colliders_;
  std::vector<ContactLaw> laws_;
  std::vector<ContactMemory> memory_;  ///< per particle
  std::vector<BlockNear> blocks_;
  double deepest_ = 0.0;  ///< of the frame's references before this one [m]
  double largest_edge_ = 0.0;
  double frame_seconds_ = 0.0;
  double acceleration_ = 0.0;
};

/// Node-wise contact: nodes that are inside a collider where they are now, so that a node which has
/// come in stays held while the reference lasts, and gives its momentum once.
class RenewedNodeContact {
 public:
  explicit RenewedNodeContact(std::vector<shape::ColliderPtr> colliders)
      : colliders_(std::move(colliders)) {}
  [[nodiscard]] bool any() const { return !colliders_.empty(); }
  void wake(std::size_t node_blocks) { until_.assign(node_blocks, -1e30); }
  void begin_frame(double frame_seconds, double acceleration) {
    frame_seconds_ = frame_seconds;
    acceleration_ = acceleration;
  }
  /// Applies contact to node block b at `coordinates`; fields [3][64], mass [64].
  void apply(std::size_t b, const Vec3i& coordinates, double dx, double time, const double* mass,
             const double* displacement, double* velocity);

 private:
  std::vector<shape::ColliderPtr> colliders_;
  std::vector<double> until_;  ///< per node block: no node is inside before [s]
  double frame_seconds_ = 0.0;
  double acceleration_ = 0.0;
};

extern template class RenewedContact<float>;
extern template class RenewedContact<double>;

}  // namespace matterfit::mpm
