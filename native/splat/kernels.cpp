// SPDX-License-Identifier: GPL-3.0-or-later
#include "splat/frame.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that each is compiled once per target.
#include "splat/gaussian_kernel-inl.hpp"
#include "splat/tile_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

const splat::Kernels& splat_table() {
  static const splat::Kernels kTable{project_gaussians, find_pairs, render_tile, differentiate_tile,
                                     gather_gradients};
  return kTable;
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "math/simd_dispatch.hpp"

namespace matterfit::splat {

const Kernels& kernels(SimdTarget target) {
  switch (highway_target(target)) {
    MATTERFIT_AVX3_CASE(splat_table)
    MATTERFIT_AVX2_CASE(splat_table)
    default:
      return N_SSE4::splat_table();
  }
}

}  // namespace matterfit::splat
#endif
