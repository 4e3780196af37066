// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "base/parallel.hpp"
#include "mpm/gradient.hpp"
#include "mpm/renewed_adjoint_kernels.hpp"
#include "mpm/renewed_back.hpp"
#include "mpm/start_cotangents.hpp"

namespace matterfit::mpm {

/// The adjoint of RenewedGroup: the substeps between two renewals, whose state are the nodes and
/// each law's history; renewals, in which particles take the nodes' motion along to others; contact
/// with colliders and by nodes; and terms. Exact for the discrete scheme. When the reference is
/// renewed is taken as given: that the motion decides it has no derivative. The same bits for any
/// number of threads.
template <class S>
class RenewedAdjoint {
 public:
  /// `bodies` as RenewedGroup was given them; `rates`: GradientOptions::of_no_damping.
  RenewedAdjoint(const Scene& scene, const std::vector<std::size_t>& bodies,
                 const RenewedAdjointKernels<S>& kernels, bool rates = true);
  ~RenewedAdjoint();
  RenewedAdjoint(const RenewedAdjoint&) = delete;
  RenewedAdjoint& operator=(const RenewedAdjoint&) = delete;

  /// Cotangents of zero at `state`, the last of a run.
  [[nodiscard]] RenewedCotangents<S> zero(const RenewedState<S>& state) const;
  /// Whether the way back over a substep needs what happened inside it
  /// (RenewedGroup::look_into): the state before a renewal, or velocities before contact by nodes.
  [[nodiscard]] bool looks_into(const RenewedSubstep& substep) const;
  /// Takes `bar` from after the substep to before it. `after`: a state with the history after it;
  /// `pushed`: the velocities of nodes between its forces and contact by nodes, which are those of
  /// `after` where it was not looked into.
  void substep(Arena& arena, const RenewedSubstep& substep, const RenewedState<S>& before,
               const std::vector<double>& pushed, const RenewedState<S>& after,
               RenewedCotangents<S>& bar);
  /// Takes `bar` from after the renewal of the reference at the end of a substep to before it.
  void renewal(Arena& arena, const RenewedState<S>& left, const RenewedState<S>& entered,
               RenewedCotangents<S>& bar) const;
  /// Adds the cotangents of the particles of `state` (world axes) by what a loss says of each body
  /// of the scene.
  void observe(Arena& arena, const RenewedState<S>& state, const FrameLoss& loss,
               RenewedCotangents<S>& bar) const;
  /// The cotangents of the n-th body's start, with `bar` taken back to `first`, the first state.
  [[nodiscard]] StartCotangents start(Arena& arena, std::size_t body, const RenewedState<S>& first,
                                      const RenewedCotangents<S>& bar) const;
  [[nodiscard]] material::MaterialGradient material_gradient(std::size_t body,
                                                             const RenewedCotangents<S>& bar) const;
  /// UpdatedAdjoint::add_terms.
  void add_terms(std::size_t body, const RenewedCotangents<S>& bar, double density_bar,
                 std::vector<std::vector<double>>& effects,
                 material::MaterialGradient& material) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class RenewedAdjoint<float>;
extern template class RenewedAdjoint<double>;

}  // namespace matterfit::mpm
