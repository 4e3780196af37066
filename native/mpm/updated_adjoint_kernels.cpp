// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_adjoint_kernels.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mpm/updated_adjoint_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that each is compiled once per target.
#include "mpm/updated_adjoint_kernel-inl.hpp"
#include "mpm/updated_published-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
const mpm::UpdatedAdjointKernels<S>& updated_adjoint_table() {
  static const mpm::UpdatedAdjointKernels<S> kTable{updated_block_adjoint<S>,
                                                    updated_published_block_adjoint<S>};
  return kTable;
}
const mpm::UpdatedAdjointKernels<float>& updated_adjoint_table_float() {
  return updated_adjoint_table<float>();
}
#if HWY_TARGET == HWY_SSE4
// For proofs.
const mpm::UpdatedAdjointKernels<double>& updated_adjoint_table_double() {
  return updated_adjoint_table<double>();
}
#endif

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "mpm/simd_dispatch.hpp"

namespace matterfit::mpm {

MATTERFIT_DISPATCH(UpdatedAdjointKernels, updated_adjoint_kernels, updated_adjoint_table)

}  // namespace matterfit::mpm
#endif
