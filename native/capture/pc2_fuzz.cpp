// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read or refused by an Error.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.hpp"
#include "capture/pc2.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  try {
    const auto cache = matterfit::capture::parse_pc2(bytes, "fuzz.pc2");
    if (cache.positions.size() != cache.points * cache.samples * 3) __builtin_trap();
  } catch (const matterfit::Error&) {
  }
  return 0;
}
