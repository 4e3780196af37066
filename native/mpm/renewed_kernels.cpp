// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_kernels.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mpm/renewed_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that it is compiled once per target.
#include "mpm/renewed_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
const mpm::RenewedKernels<S>& renewed_table() {
  static const mpm::RenewedKernels<S> kTable{renewed_forces<S>, renewed_departure<S>,
                                             renewed_leave<S>, renewed_enter<S>};
  return kTable;
}
const mpm::RenewedKernels<float>& renewed_table_float() { return renewed_table<float>(); }
#if HWY_TARGET == HWY_SSE4
// For proofs.
const mpm::RenewedKernels<double>& renewed_table_double() { return renewed_table<double>(); }
#endif

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "mpm/simd_dispatch.hpp"

namespace matterfit::mpm {

MATTERFIT_DISPATCH(RenewedKernels, renewed_kernels, renewed_table)

}  // namespace matterfit::mpm
#endif
