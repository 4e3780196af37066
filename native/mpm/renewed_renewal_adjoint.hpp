// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "mpm/renewed_back.hpp"
#include "mpm/start_cotangents.hpp"

namespace matterfit::mpm {

/// A renewed body as its renewals know it.
struct RenewedCargo {
  double density;
  bool fluid;            ///< RenewedBody::is_fluid
  std::size_t branches;  ///< of Maxwell
};

/// Cotangents of the momentum and mass of nodes, as a transfer from particles made them.
struct RenewedMomentumBar {
  std::vector<double> momentum;  ///< node blocks × [3][64]
  std::vector<double> mass;      ///< node blocks × [64]
};

/// Takes the cotangents of the velocities after the transfer and of the masses to those of momentum
/// and mass.
template <class S>
[[nodiscard]] RenewedMomentumBar renewed_momentum_adjoint(Arena& arena,
                                                          const RenewedState<S>& entered,
                                                          const RenewedCotangents<S>& bar);

/// What the nodes give back to the particle at `place`, which has `mass`, `velocity` and its affine
/// part C [1/s].
template <class S>
[[nodiscard]] TransferCotangents renewed_enter_adjoint(const RenewedGrid& grid, std::size_t member,
                                                       const UpdatedPlace<S>& place, double dx,
                                                       const RenewedMomentumBar& nodes, double mass,
                                                       const Vec3d& velocity, const Mat3d& affine);

/// The adjoint of a renewal: takes `bar` from the reference of `entered`, the state after it, to
/// that of `left`, the state before.
template <class S>
void renewal_adjoint(Arena& arena, const RenewedState<S>& left, const RenewedState<S>& entered,
                     const std::vector<RenewedCargo>& cargo, double dx, RenewedCotangents<S>& bar);

/// Sets the cotangents of a state to zero, at the reference of `state`; sums stay.
template <class S>
void clear_state_bars(const RenewedState<S>& state, RenewedCotangents<S>& bar,
                      const std::vector<RenewedCargo>& cargo);

}  // namespace matterfit::mpm
