// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any two files of a COLMAP model are read as cameras or refused by an Error.
// The first byte says whether they are text, the next two how long the cameras' file is.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "base/error.hpp"
#include "capture/colmap.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 3) return 0;
  const bool text = data[0] == 't';
  const std::size_t length = data[1] + std::size_t{256} * data[2];
  const std::string_view all(reinterpret_cast<const char*>(data) + 3, size - 3);
  const std::string_view cameras = all.substr(0, length);
  const std::string_view images = length < all.size() ? all.substr(length) : std::string_view();
  const auto bytes_of = [](std::string_view part) {
    return std::as_bytes(std::span(part.data(), part.size()));
  };
  try {
    const auto set =
        text ? matterfit::capture::parse_colmap_text(cameras, images, "fuzz")
             : matterfit::capture::parse_colmap_binary(bytes_of(cameras), bytes_of(images), "fuzz");
    if (set.shots.empty() || set.lenses.size() != set.cameras.size()) __builtin_trap();
    for (const auto& shot : set.shots) {
      if (shot.camera >= set.cameras.size() || shot.image.empty()) __builtin_trap();
    }
    for (const auto& camera : set.cameras) {
      if (!(camera.fx > 0.0 && camera.fy > 0.0) || camera.width < 1) __builtin_trap();
      if (!camera.rotation.allFinite() || !camera.translation.allFinite()) __builtin_trap();
    }
  } catch (const matterfit::Error&) {
  }
  return 0;
}
