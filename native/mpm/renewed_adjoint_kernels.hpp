// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "mpm/adjoint_kernels.hpp"
#include "mpm/renewed_kernels.hpp"

namespace matterfit::mpm {

/// The adjoint of RenewedKernels::forces. Particles lie where the last renewal put them, which is
/// an outcome of the motion, so that their places have cotangents too.
template <class S>
struct RenewedAdjointView {
  RenewedView<S> forward;   ///< displacement, velocity and history before the substep; only read
  const double* force_bar;  ///< per node block [3][64]: cotangent of the node forces
  S* displacement_bar;      ///< out, per block [3][216]
  S* velocity_bar;          ///< out, per block [3][216]; written if damped
  S* place_bar;             ///< in and out, per chunk [3][16]: of x/dx − base
  S* history_bar;           ///< in and out, per chunk [renewed_history()][16]: after, then before
  S* maxwell_bar;           ///< in and out, per chunk and branch [6][16]
  LawCotangents* law_bar;   ///< out, per block
};

template <class S>
struct RenewedAdjointKernels {
  void (*forces)(const RenewedAdjointView<S>& view, std::size_t block);
};

/// Those of an instruction set, as kernels().
template <class S>
[[nodiscard]] const RenewedAdjointKernels<S>& renewed_adjoint_kernels(SimdTarget target);

}  // namespace matterfit::mpm
