// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "mpm/updated_grid.hpp"
#include "mpm/updated_member.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

/// The scene's colliders that grid nodes meet, or those that particles do.
[[nodiscard]] std::vector<shape::ColliderPtr> colliders_met(const Scene& scene, bool by_nodes);

/// Particle-wise contact of updated Lagrangian bodies with the scene's colliders: impulses that the
/// grid takes up in the substep that follows. Blocks that cannot reach a surface sleep until they
/// could.
template <class S>
class UpdatedContact {
 public:
  explicit UpdatedContact(std::vector<shape::ColliderPtr> colliders)
      : colliders_(std::move(colliders)) {}

  [[nodiscard]] const std::vector<shape::ColliderPtr>& colliders() const { return colliders_; }
  /// A body's particles may touch: `edge` of the largest at rest [m].
  void allow(double edge) { largest_edge_ = std::max(largest_edge_, edge); }
  /// At the start of a frame; `pull`: acceleration of gravity [m/s²].
  void wake(double frame_seconds, double pull) {
    frame_seconds_ = frame_seconds;
    pull_ = pull;
  }
  [[nodiscard]] double pull() const { return pull_; }
  /// The particles of block `b` at `time`. `max_speed`: of any particle [m/s]. `touches` gets each
  /// one that touches, if not null.
  void apply(UpdatedGrid<S>& grid, std::vector<UpdatedMember<S>>& members, std::size_t b,
             double time, double dt, double max_speed, std::vector<UpdatedTouch<S>>* touches) const;

 private:
  std::vector<shape::ColliderPtr> colliders_;
  double largest_edge_ = 0.0;
  double frame_seconds_ = 0.0;
  double pull_ = 0.0;
};

extern template class UpdatedContact<float>;
extern template class UpdatedContact<double>;

}  // namespace matterfit::mpm
