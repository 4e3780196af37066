// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/jpeg.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <jpeglib.h>  // NOLINT: after <cstdio>

#include <cstdio>
#include <cstdlib>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

using ::testing::HasSubstr;

/// A JPEG of `components` (1: grey, 3: RGB, 4: CMYK) whose values `at` gives.
template <class Value>
std::vector<std::byte> jpeg_of(int width, int height, int components, bool progressive,
                               const Value& at) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &memory, &size);
  info.image_width = static_cast<JDIMENSION>(width);
  info.image_height = static_cast<JDIMENSION>(height);
  info.input_components = components;
  info.in_color_space = components == 1 ? JCS_GRAYSCALE : components == 3 ? JCS_RGB : JCS_CMYK;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, 98, TRUE);
  info.comp_info[0].h_samp_factor = info.comp_info[0].v_samp_factor = 1;  // 4:4:4
  if (progressive) jpeg_simple_progression(&info);
  jpeg_start_compress(&info, TRUE);
  std::vector<unsigned char> row(std::size_t(width) * std::size_t(components));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < components; ++c)
        row[std::size_t(x) * std::size_t(components) + std::size_t(c)] = at(x, y, c);
    }
    JSAMPROW rows[] = {row.data()};
    jpeg_write_scanlines(&info, rows, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  const auto* begin = reinterpret_cast<const std::byte*>(memory);
  std::vector<std::byte> bytes(begin, begin + size);
  std::free(memory);
  return bytes;
}

unsigned char ramp(int x, int y, int c) {
  return static_cast<unsigned char>(20 + 4 * x + 2 * y + 30 * c);
}

TEST(Jpeg, ColoursAreReadWithinWhatTheCompressionLoses) {
  for (const bool progressive : {false, true}) {
    const auto bytes = jpeg_of(23, 17, 3, progressive, ramp);
    EXPECT_EQ(jpeg_size(bytes, "a.jpg"), (std::array<int, 2>{23, 17}));
    const Bitmap bitmap = parse_jpeg(bytes, "a.jpg");
    ASSERT_EQ(bitmap.width, 23);
    ASSERT_EQ(bitmap.height, 17);
    EXPECT_FALSE(bitmap.has_alpha);
    for (int y = 0; y < 17; ++y) {
      for (int x = 0; x < 23; ++x) {
        const std::uint8_t* rgba = bitmap.rgba.data() + std::size_t(4) * std::size_t(y * 23 + x);
        for (int c = 0; c < 3; ++c) ASSERT_NEAR(rgba[c], ramp(x, y, c), 3);
        ASSERT_EQ(rgba[3], 255);
      }
    }
  }
}

TEST(Jpeg, GreyIsAllThreeColours) {
  const Bitmap bitmap = parse_jpeg(jpeg_of(8, 8, 1, false, ramp), "a.jpg");
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(bitmap.rgba[std::size_t(4 * (3 * 8 + 5) + c)], 46, 2);
}

TEST(Jpeg, WhatIsNoneIsRefusedByName) {
  const auto message_of = [](const std::vector<std::byte>& bytes) -> std::string {
    try {
      (void)parse_jpeg(bytes, "frame_7.jpg");
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return "";
  };
  const auto whole = jpeg_of(64, 64, 3, false, ramp);
  for (const double share : {0.1, 0.5, 0.95}) {
    const auto end = whole.begin() + std::ptrdiff_t(share * double(whole.size()));
    EXPECT_THAT(message_of({whole.begin(), end}), HasSubstr("frame_7.jpg: cannot be read as JPEG"));
  }
  EXPECT_THAT(message_of({}), HasSubstr("cannot be read as JPEG"));
  EXPECT_THAT(message_of(jpeg_of(8, 8, 4, false, ramp)), HasSubstr("of four colours (CMYK)"));
  // Its head says 40000 × 40000: bytes 5 to 8 of the frame's head.
  auto huge = whole;
  for (std::size_t i = 0; i + 9 < huge.size(); ++i) {
    if (huge[i] != std::byte{0xff} || huge[i + 1] != std::byte{0xc0}) continue;
    huge[i + 5] = huge[i + 7] = std::byte{0x9c};
    break;
  }
  EXPECT_THAT(message_of(huge), HasSubstr("at most 16384 along an edge are read"));
}

}  // namespace
}  // namespace matterfit::capture
