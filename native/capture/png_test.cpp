// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/png.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

fs::path scratch(const std::string& name) {
  return fs::temp_directory_path() / ("matterfit_" + std::to_string(::getpid()) + "_" + name);
}

Bitmap pattern(bool alpha) {
  Bitmap bitmap(5, 3);
  bitmap.has_alpha = alpha;
  for (std::size_t i = 0; i < bitmap.rgba.size(); ++i) {
    bitmap.rgba[i] = static_cast<std::uint8_t>(37 * i + 11);
    if (!alpha && i % 4 == 3) bitmap.rgba[i] = 255;
  }
  return bitmap;
}

TEST(Png, WhatIsWrittenIsReadAgain) {
  for (const bool alpha : {false, true}) {
    const Bitmap before = pattern(alpha);
    const fs::path path = scratch("pattern.png");
    write_png(path, before);
    const Bitmap after = read_png(path);
    const auto bytes = read_file(path);
    EXPECT_EQ(png_size(bytes, "a.png"), (std::array<int, 2>{5, 3}));
    write_png(path, before);
    EXPECT_EQ(bytes, read_file(path));
    fs::remove(path);
    EXPECT_EQ(after.width, 5);
    EXPECT_EQ(after.height, 3);
    EXPECT_EQ(after.has_alpha, alpha);
    EXPECT_EQ(after.rgba, before.rgba);
  }
}

TEST(Png, WhatIsNoneIsRefusedByName) {
  const fs::path path = scratch("none.png");
  write_png(path, pattern(true));
  auto bytes = read_file(path);
  fs::remove(path);
  bytes.resize(bytes.size() / 2);
  for (const auto& broken : {bytes, std::vector<std::byte>(40), std::vector<std::byte>{}}) {
    try {
      (void)parse_png(broken, "matte_7.png");
      ADD_FAILURE() << "nothing was thrown";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      EXPECT_THAT(error.what(), HasSubstr("matte_7.png: cannot be read as PNG"));
    }
  }
}

}  // namespace
}  // namespace matterfit::capture
