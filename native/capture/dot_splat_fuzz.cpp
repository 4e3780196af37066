// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read or refused by an Error.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.hpp"
#include "capture/dot_splat.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  try {
    const auto splats = matterfit::capture::parse_dot_splat(bytes, "fuzz.splat");
    if (splats.sh.size() != splats.size() * splats.sh_bands() * 3) __builtin_trap();
    if (splats.rotations.size() != splats.size()) __builtin_trap();
    for (const auto& scale : splats.scales) {
      if (!(scale.minCoeff() > 0.0F)) __builtin_trap();
    }
  } catch (const matterfit::Error&) {
  }
  return 0;
}
