// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read or refused by an Error.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.hpp"
#include "capture/exr.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  try {
    // Large images only cost time.
    const auto [width, height] = matterfit::capture::exr_size(bytes, "fuzz.exr");
    if (width > 512 || height > 512) return 0;
    const auto bitmap = matterfit::capture::parse_exr(bytes, "fuzz.exr");
    if (bitmap.width != width || bitmap.height != height) __builtin_trap();
    if (bitmap.rgba.size() != 4 * bitmap.pixels() || bitmap.pixels() == 0) __builtin_trap();
  } catch (const matterfit::Error&) {
  }
  return 0;
}
