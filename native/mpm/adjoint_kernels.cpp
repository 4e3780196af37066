// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/adjoint_kernels.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mpm/adjoint_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that each is compiled once per target.
#include "mpm/total_adjoint_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
const mpm::AdjointKernels<S>& adjoint_table() {
  static const mpm::AdjointKernels<S> kTable{total_forces_adjoint<S>};
  return kTable;
}
const mpm::AdjointKernels<float>& adjoint_table_float() { return adjoint_table<float>(); }
#if HWY_TARGET == HWY_SSE4
// For proofs.
const mpm::AdjointKernels<double>& adjoint_table_double() { return adjoint_table<double>(); }
#endif

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "material/classical/law_gradient.hpp"
#include "mpm/simd_dispatch.hpp"

namespace matterfit::mpm {

LawCotangents& LawCotangents::operator+=(const LawCotangents& other) {
  constants += other.constants;
  work += other.work;
  for (std::size_t i = 0; i < stiffness.size(); ++i) {
    stiffness[i] += other.stiffness[i];
    relaxed[i] += other.relaxed[i];
  }
  return *this;
}

void LawCotangents::add_branches(const material::Material& material, double dt,
                                 std::vector<material::MaxwellBranch>& sums) const {
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const material::MaxwellBranch g =
        material::maxwell_gradient(material.maxwell[i], dt, stiffness[i], relaxed[i]);
    sums[i].modulus += g.modulus;
    sums[i].time += g.time;
  }
}

MATTERFIT_DISPATCH(AdjointKernels, adjoint_kernels, adjoint_table)

}  // namespace matterfit::mpm
#endif
