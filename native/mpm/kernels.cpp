// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/kernels.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mpm/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// After foreach_target, so that each is compiled once per target.
#include "mpm/total_kernel-inl.hpp"
#include "mpm/updated_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

template <class S>
const mpm::Kernels<S>& table() {
  static const mpm::Kernels<S> kTable{updated_block<S>, updated_scatter<S>, total_forces<S>,
                                      total_smooth<S>};
  return kTable;
}
const mpm::Kernels<float>& table_float() { return table<float>(); }
const mpm::Kernels<double>& table_double() { return table<double>(); }

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "base/error.hpp"

namespace matterfit::mpm {
namespace {

/// The target to run, as a Highway bit. A pinned one must be there; kAuto takes the best.
std::int64_t chosen(SimdTarget target) {
  const std::int64_t have = hwy::SupportedTargets() & HWY_TARGETS;
  const auto pinned = [&](std::int64_t bit, const char* name) {
    if ((have & bit) == 0) {
      throw_input(std::string("target ") + name +
                  ": this processor does not have it. Use 'auto' or a lower one (sse4, avx2).");
    }
    return bit;
  };
  switch (target) {
    case SimdTarget::kSse4:
      return pinned(HWY_SSE4, "sse4");
    case SimdTarget::kAvx2:
      return pinned(HWY_AVX2, "avx2");
    case SimdTarget::kAvx512:
      return pinned(HWY_AVX3, "avx512");
    case SimdTarget::kAuto:
      break;
  }
  if ((have & HWY_AVX3) != 0) return HWY_AVX3;
  if ((have & HWY_AVX2) != 0) return HWY_AVX2;
  return HWY_SSE4;
}

}  // namespace

// A build may leave targets out: the one under sanitizers has the lowest alone.
#if (HWY_TARGETS & HWY_AVX3) != 0
#define MATTERFIT_AVX3_CASE(table) \
  case HWY_AVX3:                   \
    return N_AVX3::table();
#else
#define MATTERFIT_AVX3_CASE(table)
#endif
#if (HWY_TARGETS & HWY_AVX2) != 0
#define MATTERFIT_AVX2_CASE(table) \
  case HWY_AVX2:                   \
    return N_AVX2::table();
#else
#define MATTERFIT_AVX2_CASE(table)
#endif

template <>
const Kernels<float>& kernels<float>(SimdTarget target) {
  switch (chosen(target)) {
    MATTERFIT_AVX3_CASE(table_float)
    MATTERFIT_AVX2_CASE(table_float)
    default:
      return N_SSE4::table_float();
  }
}

template <>
const Kernels<double>& kernels<double>(SimdTarget target) {
  switch (chosen(target)) {
    MATTERFIT_AVX3_CASE(table_double)
    MATTERFIT_AVX2_CASE(table_double)
    default:
      return N_SSE4::table_double();
  }
}

}  // namespace matterfit::mpm
#endif
