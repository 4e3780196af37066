// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace matterfit {

/// Instruction set of the kernels. Results are bit-for-bit equal for any number of threads on one
/// target; between targets they differ by rounding.
enum class SimdTarget { kAuto, kSse4, kAvx2, kAvx512 };

}  // namespace matterfit
