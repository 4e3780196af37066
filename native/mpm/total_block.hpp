// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "mpm/total_block_field.hpp"
#include "mpm/total_body.hpp"

namespace matterfit::mpm {

/// A total Lagrangian body around one of its blocks, as it is now: for looking at many points
/// there. It gives the same for points elsewhere, more slowly.
template <class S>
class TotalBlock {
 public:
  using Place = typename TotalBody<S>::Place;

  TotalBlock(const TotalBody<S>& body, std::size_t block) : body_(body), block_(block) {
    displacement_.gather(body.grid(), block, body.displacement().data());
    velocity_.gather(body.grid(), block, body.velocity().data());
  }
  [[nodiscard]] bool holds(const Place& place) const { return place.cell.block == block_; }
  [[nodiscard]] const BlockField& displacement() const { return displacement_; }
  [[nodiscard]] const BlockField& velocity() const { return velocity_; }

  [[nodiscard]] typename TotalBody<S>::PointState state(const Place& place) const {
    if (!holds(place)) return body_.state(body_.point(place));
    const BlockField::Stencil s(place.cell, body_.grid().dx());
    return body_.state(place, displacement_.at(s), velocity_.at(s));
  }
  [[nodiscard]] Mat3d deformation_gradient(const Place& place) const {
    if (!holds(place)) return body_.deformation_gradient(body_.point(place));
    const BlockField::Stencil s(place.cell, body_.grid().dx());
    return body_.deformation_gradient(displacement_.gradient(s));
  }

 private:
  const TotalBody<S>& body_;
  std::size_t block_;
  BlockField displacement_;
  BlockField velocity_;
};

}  // namespace matterfit::mpm
