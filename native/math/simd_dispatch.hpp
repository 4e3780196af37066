// SPDX-License-Identifier: GPL-3.0-or-later
// What a source that Highway compiles once per target needs to choose between them. Include it
// under HWY_ONCE.
#pragma once

#include <hwy/targets.h>

#include <cstdint>
#include <string>

#include "base/error.hpp"
#include "math/simd_target.hpp"

namespace matterfit {

/// The target to run, as a Highway bit. A pinned one must be there (else Error(kInput)); kAuto
/// takes the best.
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

}  // namespace matterfit

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
