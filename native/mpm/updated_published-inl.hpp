// SPDX-License-Identifier: GPL-3.0-or-later
// The kernels of updated_published_kernels.cpp, for the tables of kernels. Included once per SIMD
// target.
#if defined(MATTERFIT_MPM_UPDATED_PUBLISHED_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MATTERFIT_MPM_UPDATED_PUBLISHED_INL_HPP
#undef MATTERFIT_MPM_UPDATED_PUBLISHED_INL_HPP
#else
#define MATTERFIT_MPM_UPDATED_PUBLISHED_INL_HPP
#endif

#include "mpm/kernels.hpp"
#include "mpm/updated_adjoint_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
void updated_published_block(mpm::UpdatedView<S>& view);
template <class S>
void updated_published_block_adjoint(mpm::UpdatedAdjointView<S>& view);

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
