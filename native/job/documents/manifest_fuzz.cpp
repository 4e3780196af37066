// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read as a manifest or refused by an Error; no path in it leaves
// the cache folder.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/error.hpp"
#include "job/documents/manifest.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const auto manifest =
        matterfit::job::parse_manifest({reinterpret_cast<const char*>(data), size}, "fuzz");
    for (const auto& [path, file] : manifest.files) {
      const std::filesystem::path inside(path);
      if (inside.is_absolute() || *inside.begin() == "..") __builtin_trap();
    }
  } catch (const matterfit::Error&) {
  }
  return 0;
}
