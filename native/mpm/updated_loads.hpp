// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "mpm/scene.hpp"
#include "mpm/updated_load.hpp"
#include "mpm/updated_member.hpp"
#include "mpm/updated_terms.hpp"

namespace matterfit::mpm {

/// All that acts on the bodies of a group, in the order in which it acts: the effects' terms,
/// contact of particles with colliders, pins, attached masses. What the scene does not have is not
/// in the list. (Contact of nodes is the grid's: node_contact.hpp.)
template <class S>
class UpdatedLoads {
 public:
  /// `bodies`: into scene.bodies, of `members`, whose memories of contact it keeps up. All are
  /// borrowed. Throws Error(kInput) for a pin or a mass that is not on its body.
  UpdatedLoads(const Scene& scene, const std::vector<std::size_t>& bodies,
               std::vector<UpdatedMember<S>>& members);

  /// Those of each body, also where there are none.
  [[nodiscard]] const UpdatedTerms<S>& terms() const { return *terms_; }
  [[nodiscard]] const std::vector<UpdatedLoad<S>*>& list() const { return list_; }
  [[nodiscard]] bool push_by_velocity() const;

  void begin_frame(double frame_seconds, double pull) const;
  void push(Arena& arena, UpdatedGrid<S>& grid, const effects::Moment& moment, double kick) const;
  /// On the particles of block `b`. `acts`, if not null, gets those of each load.
  void act(UpdatedGrid<S>& grid, std::size_t b, const UpdatedMoment& moment,
           std::vector<UpdatedActsPtr>* acts) const;
  /// Back over what act() did in all blocks, the last load first.
  void act_adjoint(Arena& arena, const UpdatedBack<S>& at, const std::vector<UpdatedActsPtr>& acts,
                   UpdatedCotangents<S>& bar, std::vector<double>& velocity_bar) const;

 private:
  std::vector<std::unique_ptr<UpdatedLoad<S>>> loads_;
  UpdatedTerms<S>* terms_ = nullptr;
  std::vector<UpdatedLoad<S>*> list_;  ///< of `loads_`, those that have something to act on
};

extern template class UpdatedLoads<float>;
extern template class UpdatedLoads<double>;

}  // namespace matterfit::mpm
