// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read or refused by an Error.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.hpp"
#include "capture/mesh.hpp"
#include "capture/ply.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  try {
    const auto ply = matterfit::capture::parse_ply(bytes, "fuzz.ply");
    for (const auto& element : ply.elements) {
      for (const auto& property : element.properties) {
        const std::size_t expected = property.is_list ? property.sizes.size() : element.count;
        if (expected != element.count) __builtin_trap();
        if (!property.is_list && property.doubles().size() != element.count) __builtin_trap();
        (void)property.integers();
      }
    }
  } catch (const matterfit::Error&) {
  }
  try {
    (void)matterfit::capture::parse_mesh_ply(bytes, "fuzz.ply");
  } catch (const matterfit::Error&) {
  }
  return 0;
}
