// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "material/classical/constants_adjoint.hpp"
#include "material/material.hpp"
#include "mpm/kernels.hpp"

namespace matterfit::mpm {

/// Cotangents of a law's constants, and of each Maxwell branch's stiffness and relaxed share
/// (material/classical/maxwell-inl.hpp), summed over a block.
struct LawCotangents {
  material::ConstantsAdjoint<double> constants{};
  std::array<double, material::kMostMaxwellBranches> stiffness{};
  std::array<double, material::kMostMaxwellBranches> relaxed{};
  double work = 0.0;  ///< force_bar · force

  LawCotangents& operator+=(const LawCotangents& other);
  /// Adds to the cotangents of a material's branches, by modulus and time, those of a substep.
  void add_branches(const material::Material& material, double dt,
                    std::vector<material::MaxwellBranch>& sums) const;
};

/// The adjoint of a substep's internal forces of a total Lagrangian body.
template <class S>
struct TotalAdjointView {
  TotalView<S> forward;     ///< displacement, velocity and history before the substep
  const double* force_bar;  ///< per node block [3][64]: cotangent of the node forces
  S* displacement_bar;      ///< out, per block [3][216]
  S* velocity_bar;          ///< out, per block [3][216]; written if damped
  S* plastic_bar;           ///< in and out, per chunk [10][16]: of the history after, then before
  S* maxwell_bar;           ///< in and out, per chunk and branch [6][16]
  LawCotangents* law_bar;   ///< out, per block
};

template <class S>
struct AdjointKernels {
  void (*total_forces)(const TotalAdjointView<S>& view, std::size_t block);
};

/// Those of an instruction set, as kernels().
template <class S>
[[nodiscard]] const AdjointKernels<S>& adjoint_kernels(SimdTarget target);

}  // namespace matterfit::mpm
