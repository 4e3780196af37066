// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer program: any bytes are read as a job document or refused by an Error, and what is read
// can be written and read again.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/error.hpp"
#include "job/documents/document.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  matterfit::job::ReadOptions options;
  options.base_folder = "/fuzz";
  try {
    const auto job = matterfit::job::read_job(text, options);
    const std::string written = matterfit::job::write_job(job, "/fuzz/deeper");
    options.base_folder = "/fuzz/deeper";
    try {
      (void)matterfit::job::read_job(written, options);
    } catch (const matterfit::Error&) {
      __builtin_trap();
    }
  } catch (const matterfit::Error&) {
  }
  return 0;
}
