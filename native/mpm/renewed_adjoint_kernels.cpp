// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_adjoint_kernels.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mpm/renewed_adjoint_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that it is compiled once per target.
#include "mpm/renewed_adjoint_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
const mpm::RenewedAdjointKernels<S>& renewed_adjoint_table() {
  static const mpm::RenewedAdjointKernels<S> kTable{renewed_forces_adjoint<S>};
  return kTable;
}
const mpm::RenewedAdjointKernels<float>& renewed_adjoint_table_float() {
  return renewed_adjoint_table<float>();
}
#if HWY_TARGET == HWY_SSE4
// For proofs.
const mpm::RenewedAdjointKernels<double>& renewed_adjoint_table_double() {
  return renewed_adjoint_table<double>();
}
#endif

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "mpm/simd_dispatch.hpp"

namespace matterfit::mpm {

MATTERFIT_DISPATCH(RenewedAdjointKernels, renewed_adjoint_kernels, renewed_adjoint_table)

}  // namespace matterfit::mpm
#endif
