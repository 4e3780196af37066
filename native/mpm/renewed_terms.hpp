// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "mpm/body_terms.hpp"
#include "mpm/renewed_body.hpp"

namespace matterfit::mpm {

/// The terms on the bodies of the renewed formulation: their forces and stresses at the particles,
/// on the nodes by the weights that the masses have too, and by their slopes.
template <class S>
class RenewedTerms {
 public:
  /// `bodies`: into scene.bodies, the members of the group.
  RenewedTerms(const Scene& scene, const std::vector<std::size_t>& bodies);

  /// Adds the forces on block b of a member to its halo. `nodes`: the block's own eight of
  /// RenewedGrid::nodes_of; fields as RenewedGroup has them.
  void add(RenewedBody<S>& body, std::size_t member, std::size_t b, const std::uint32_t* nodes,
           const std::vector<double>& displacement, const std::vector<double>& velocity, double dx,
           const effects::Moment& moment) const;
  [[nodiscard]] const BodyTerms& of(std::size_t member) const { return *terms_[member]; }
  /// The largest acceleration [m/s²] that they give to what moves at `speed` [m/s].
  [[nodiscard]] double acceleration_bound(double speed) const;

 private:
  std::vector<std::unique_ptr<BodyTerms>> terms_;
};

extern template class RenewedTerms<float>;
extern template class RenewedTerms<double>;

}  // namespace matterfit::mpm
