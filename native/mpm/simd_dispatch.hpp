// SPDX-License-Identifier: GPL-3.0-or-later
// What a source that Highway compiles once per target needs to choose between them. Include it
// under HWY_ONCE.
#pragma once

#include <hwy/targets.h>

#include <cstdint>
#include <string>

#include "base/error.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::mpm {

/// The target to run, as a Highway bit. A pinned one must be there; kAuto takes the best.
inline std::int64_t highway_target(SimdTarget target) {
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

}  // namespace matterfit::mpm

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

// NOLINTBEGIN(bugprone-macro-parentheses): names of what is defined cannot stand in any.
/// Defines functions<float>(target), which returns N_TARGET::table_float() of the target to run,
/// and functions<double>(target), which has the lowest target alone.
#define MATTERFIT_DISPATCH(Functions, functions, table)         \
  template <>                                                   \
  const Functions<float>& functions<float>(SimdTarget target) { \
    switch (highway_target(target)) {                           \
      MATTERFIT_AVX3_CASE(table##_float)                        \
      MATTERFIT_AVX2_CASE(table##_float)                        \
      default:                                                  \
        return N_SSE4::table##_float();                         \
    }                                                           \
  }                                                             \
  template <>                                                   \
  const Functions<double>& functions<double>(SimdTarget) {      \
    return N_SSE4::table##_double();                            \
  }
// NOLINTEND(bugprone-macro-parentheses)
