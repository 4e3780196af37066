// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read or refused by an Error.
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/error.hpp"
#include "capture/mesh.hpp"
#include "capture/npz.hpp"

namespace {

/// What was accepted must be whole: as many values as the shape says, and it can be written again.
void check(const matterfit::capture::Array& array) {
  std::size_t count = 1;
  for (const std::size_t n : array.shape) count *= n;
  if (count != array.size()) __builtin_trap();
  if (count < 1000) (void)matterfit::capture::format_npy(array);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  // The same bytes as an archive, as one array, and as a cage.
  const bool array = !bytes.empty() && bytes[0] == std::byte{0x93};
  try {
    if (array) {
      check(matterfit::capture::parse_npy(bytes, "fuzz.npy"));
    } else {
      for (const auto& [name, read] : matterfit::capture::parse_npz(bytes, "fuzz.npz")) check(read);
    }
  } catch (const matterfit::Error&) {
  }
  try {
    (void)matterfit::capture::parse_mesh_npz(bytes, "fuzz.npz");
  } catch (const matterfit::Error&) {
  }
  return 0;
}
