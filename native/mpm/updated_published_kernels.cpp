// SPDX-License-Identifier: GPL-3.0-or-later
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mpm/updated_published_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that each is compiled once per target.
#include "mpm/updated_adjoint_kernel-inl.hpp"
#include "mpm/updated_published-inl.hpp"
#include "mpm/updated_published_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
void updated_published_block_adjoint(mpm::UpdatedAdjointView<S>& view) {
  UpdatedBlockAdjoint<StressFamily::kPublished, S>(view).run();
}

template void updated_published_block<float>(mpm::UpdatedView<float>& view);
template void updated_published_block_adjoint<float>(mpm::UpdatedAdjointView<float>& view);
#if HWY_TARGET == HWY_SSE4
// For proofs.
template void updated_published_block<double>(mpm::UpdatedView<double>& view);
template void updated_published_block_adjoint<double>(mpm::UpdatedAdjointView<double>& view);
#endif

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
