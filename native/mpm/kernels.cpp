// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/kernels.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mpm/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that each is compiled once per target.
#include "mpm/total_kernel-inl.hpp"
#include "mpm/updated_kernel-inl.hpp"
#include "mpm/updated_published-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
const mpm::Kernels<S>& table() {
  static const mpm::Kernels<S> kTable{updated_block<S>,   updated_published_block<S>,
                                      updated_scatter<S>, total_forces<S>,
                                      total_smooth<S>,    total_mass<S>};
  return kTable;
}
const mpm::Kernels<float>& table_float() { return table<float>(); }
#if HWY_TARGET == HWY_SSE4
// For proofs.
const mpm::Kernels<double>& table_double() { return table<double>(); }
#endif

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "mpm/simd_dispatch.hpp"

namespace matterfit::mpm {

MATTERFIT_DISPATCH(Kernels, kernels, table)

}  // namespace matterfit::mpm
#endif
