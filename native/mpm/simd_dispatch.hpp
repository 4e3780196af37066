// SPDX-License-Identifier: GPL-3.0-or-later
// Include it under HWY_ONCE.
#pragma once

#include "math/simd_dispatch.hpp"
#include "mpm/simulation.hpp"

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
