// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any text is read as cameras or refused
// by an Error.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/error.hpp"
#include "capture/cameras.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto pixels = [](const std::string&) { return std::array<int, 2>{64, 48}; };
  try {
    const auto set = matterfit::capture::parse_cameras(text, "fuzz.json", pixels);
    if (set.shots.empty()) __builtin_trap();
    for (const auto& shot : set.shots) {
      if (shot.camera >= set.cameras.size() || shot.image.empty()) __builtin_trap();
    }
    for (const auto& camera : set.cameras) {
      if (!(camera.fx > 0.0 && camera.fy > 0.0) || camera.width < 1) __builtin_trap();
    }
  } catch (const matterfit::Error&) {
  }
  return 0;
}
