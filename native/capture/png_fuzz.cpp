// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read or refused by an Error.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.hpp"
#include "capture/png.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // Width and height stand at bytes 16 to 24: large images only cost time.
  if (size > 24 && (data[16] != 0 || data[17] != 0 || data[18] > 1 || data[20] != 0 ||
                    data[21] != 0 || data[22] > 1)) {
    return 0;
  }
  try {
    const auto bitmap =
        matterfit::capture::parse_png(std::as_bytes(std::span(data, size)), "fuzz.png");
    if (bitmap.rgba.size() != 4 * bitmap.pixels() || bitmap.pixels() == 0) __builtin_trap();
  } catch (const matterfit::Error&) {
  }
  return 0;
}
