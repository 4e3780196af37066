// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/png.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

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

/// Without gAMA and sRGB a sample of 16 bits means what its high byte means.
TEST(Png, SixteenBitsAreRoundedToEight) {
  std::vector<std::byte> bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &bytes,
      [](png_structp to, png_bytep data, png_size_t size) {
        auto* into = static_cast<std::vector<std::byte>*>(png_get_io_ptr(to));
        const auto* first = reinterpret_cast<const std::byte*>(data);
        into->insert(into->end(), first, first + size);
      },
      nullptr);
  png_set_IHDR(png, info, 2, 1, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  const png_byte row[] = {51, 51, 200, 200};
  png_write_row(png, row);
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  const Bitmap bitmap = parse_png(bytes, "deep.png");
  EXPECT_EQ(bitmap.rgba[0], 51);
  EXPECT_EQ(bitmap.rgba[4], 200);
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
