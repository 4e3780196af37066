// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/parallel.hpp"
#include "mpm/total_body.hpp"

namespace matterfit::mpm {

/// What loads a total Lagrangian body (TotalBody::add_load, set_node_forces). A body has one list
/// of them, of those that have something to act with; its adjoint goes back over the same list
/// (TotalLoadAdjoint).
template <class S>
class TotalLoad {
 public:
  TotalLoad() = default;
  virtual ~TotalLoad() = default;
  TotalLoad(const TotalLoad&) = delete;
  TotalLoad& operator=(const TotalLoad&) = delete;

  /// Adds to the loads of the body, which is at the state before `substep`, of which time, length,
  /// gravity and `held` are known.
  virtual void apply(Arena& arena, TotalBody<S>& body, const TotalSubstep& substep) = 0;
};

}  // namespace matterfit::mpm
