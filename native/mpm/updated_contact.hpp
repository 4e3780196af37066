// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/contact_law.hpp"
#include "mpm/scene.hpp"
#include "mpm/updated_load.hpp"
#include "mpm/updated_member.hpp"
#include "shape/collider_adjoint.hpp"

namespace matterfit::mpm {

template <class S>
struct UpdatedBodyCotangents;

/// The scene's colliders that grid nodes meet, or those that particles do.
[[nodiscard]] std::vector<shape::ColliderPtr> colliders_met(const Scene& scene, bool by_nodes);
/// Where those are in scene.colliders.
[[nodiscard]] std::vector<std::size_t> places_of_met(const Scene& scene, bool by_nodes);

/// A particle that touches a collider at the start of a substep, as contact_force() met it.
template <class S>
struct UpdatedTouch {
  std::uint32_t member;
  std::uint32_t particle;
  std::uint32_t collider;  ///< of the particle-wise ones
  UpdatedPlace<S> place;
  S volume;
  S velocity[3];
  S h[9];                ///< F − I
  ContactMemory memory;  ///< before
};

/// Particle-wise contact of updated Lagrangian bodies with the scene's colliders: impulses that the
/// grid takes up in the substep that follows. Blocks that cannot reach a surface sleep until they
/// could.
template <class S>
class UpdatedContact final : public UpdatedLoad<S> {
 public:
  /// Keeps up the members' memories, which are borrowed.
  UpdatedContact(const Scene& scene, std::vector<UpdatedMember<S>>& members);

  [[nodiscard]] bool any() const { return !colliders_.empty(); }
  void begin_frame(double frame_seconds, double pull) override;
  void act(UpdatedGrid<S>& grid, std::size_t b, const UpdatedMoment& moment,
           UpdatedActsPtr* acts) const override;
  void act_adjoint(Arena& arena, const UpdatedBack<S>& at, const UpdatedActs& acts,
                   UpdatedCotangents<S>& bar, std::vector<double>& velocity_bar) const override;

 private:
  /// What many touches add to.
  struct Sums {
    std::vector<shape::ColliderCotangents> colliders;
    std::vector<double> log_density;  ///< per member
  };
  void back(const UpdatedBack<S>& at, const UpdatedTouch<S>& touch, UpdatedBodyCotangents<S>& body,
            Sums& sums, std::vector<double>& velocity_bar) const;

  std::vector<UpdatedMember<S>>& members_;
  std::vector<shape::ColliderPtr> colliders_;
  std::vector<std::size_t> places_;  ///< in scene.colliders
  double largest_edge_ = 0.0;        ///< of a particle at rest [m]
  double frame_seconds_ = 0.0;
  double pull_ = 0.0;
};

extern template class UpdatedContact<float>;
extern template class UpdatedContact<double>;

}  // namespace matterfit::mpm
