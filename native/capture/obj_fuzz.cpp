// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read or refused by an Error.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.hpp"
#include "capture/mesh.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  try {
    const auto mesh = matterfit::capture::parse_mesh_obj(bytes, "fuzz.obj");
    for (const std::int32_t vertex : mesh.face_vertices) {
      if (vertex < 0 || static_cast<std::size_t>(vertex) >= mesh.vertices.size()) __builtin_trap();
    }
  } catch (const matterfit::Error&) {
  }
  return 0;
}
