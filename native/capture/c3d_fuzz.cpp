// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read or refused by an Error.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.hpp"
#include "capture/c3d.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  try {
    const auto file = matterfit::capture::parse_c3d(bytes, "fuzz.c3d");
    if (file.positions.size() != file.points * file.frames) __builtin_trap();
    if (file.labels.size() != file.points) __builtin_trap();
    (void)file.metres_per_unit();
  } catch (const matterfit::Error&) {
  }
  return 0;
}
