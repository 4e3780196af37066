// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace matterfit::bench {

/// Peak rate of single-precision fused multiply-adds that this machine gives at this moment, by
/// the best SIMD target, on `threads` threads at once [GFLOP/s]. Takes about 0.1 s. Other load on a
/// shared machine shows as a lower value; a measurement between two probes that differ is dropped.
[[nodiscard]] double peak_fma_gflops(int threads);

/// Name of the SIMD target the probe ran with ("AVX3", "AVX2", "SSE4").
[[nodiscard]] std::string probe_target();

}  // namespace matterfit::bench
