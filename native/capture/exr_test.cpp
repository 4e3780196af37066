// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/exr.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "capture/exr_for_test.hpp"
#include "capture/srgb.hpp"

namespace matterfit::capture {
namespace {

using ::testing::HasSubstr;
using Value = std::function<double(const std::string&, int, int)>;

class ExrTest : public ::testing::Test {
 protected:
  std::vector<std::byte> bytes_of(const ExrForTest& exr, const std::vector<std::string>& channels,
                                  const Value& at) {
    const auto path = scratch_.path / "a.exr";
    write_exr(path, exr, channels, at);
    return read_file(path);
  }
  static std::string message_of(const std::vector<std::byte>& bytes) {
    try {
      (void)parse_exr(bytes, "frame_7.exr");
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return "";
  }

  const Folder scratch_;
};

double light(const std::string& channel, int x, int y) {
  if (channel == "A") return 1.0;
  return 0.02 + 0.03 * x + 0.01 * y + (channel == "R" ? 0.2 : channel == "G" ? 0.1 : 0.0);
}

int expected(double linear) {
  // IEC 61966-2-1, written out a second time.
  const double v = std::min(1.0, std::max(0.0, linear));
  return int(
      std::lround(255.0 * (v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055)));
}

TEST_F(ExrTest, LightBecomesWhatDisplaysShow) {
  for (const bool tiled : {false, true}) {
    for (const auto compression :
         {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION}) {
      for (const auto type : {Imf::HALF, Imf::FLOAT}) {
        const auto bytes = bytes_of({21, 13, 0, tiled, compression, type}, {"R", "G", "B"}, light);
        EXPECT_EQ(exr_size(bytes, "a"), (std::array<int, 2>{21, 13}));
        const Bitmap bitmap = parse_exr(bytes, "a");
        EXPECT_FALSE(bitmap.has_alpha);
        for (int y = 0; y < 13; ++y) {
          for (int x = 0; x < 21; ++x) {
            const std::uint8_t* rgba =
                bitmap.rgba.data() + std::size_t(4) * std::size_t(y * 21 + x);
            ASSERT_NEAR(rgba[0], expected(light("R", x, y)), 1);
            ASSERT_NEAR(rgba[1], expected(light("G", x, y)), 1);
            ASSERT_NEAR(rgba[2], expected(light("B", x, y)), 1);
            ASSERT_EQ(rgba[3], 255);
          }
        }
      }
    }
  }
}

/// A colour of light .3 that covers a half of each pixel is stored as .15.
TEST_F(ExrTest, AlphaIsDividedOut) {
  const auto at = [](const std::string& channel, int x, int) {
    const double alpha = x == 0 ? 0.0 : x == 1 ? 0.5 : 1.0;
    return channel == "A" ? alpha : 0.3 * alpha;
  };
  const Bitmap bitmap = parse_exr(bytes_of({3, 1, 0, false}, {"R", "G", "B", "A"}, at), "a");
  EXPECT_TRUE(bitmap.has_alpha);
  EXPECT_EQ(bitmap.rgba[3], 0);
  EXPECT_EQ(bitmap.rgba[7], 128);
  EXPECT_EQ(bitmap.rgba[11], 255);
  EXPECT_NEAR(bitmap.rgba[4], expected(0.3), 1);
  EXPECT_NEAR(bitmap.rgba[8], expected(0.3), 1);
}

TEST_F(ExrTest, BrightnessAloneIsGreyAndExtremesAreCutOff) {
  const auto at = [](const std::string&, int x, int) {
    const double values[] = {0.5, 7.0, -1.0, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()};
    return values[x];
  };
  const Bitmap bitmap = parse_exr(bytes_of({5, 1, 0, false}, {"Y"}, at), "a");
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(bitmap.rgba[c], 188);
    EXPECT_EQ(bitmap.rgba[4 + c], 255);
    EXPECT_EQ(bitmap.rgba[8 + c], 0);
    EXPECT_EQ(bitmap.rgba[12 + c], 255);
    EXPECT_EQ(bitmap.rgba[16 + c], 0);
  }
}

TEST_F(ExrTest, WhatTheDataWindowLeavesIsTransparent) {
  const auto at = [](const std::string& channel, int x, int y) {
    return channel == "A" ? 1.0 : 0.01 * x + 0.02 * y;
  };
  const Bitmap bitmap = parse_exr(bytes_of({12, 9, 2, false}, {"R", "G", "B", "A"}, at), "a");
  ASSERT_EQ(bitmap.width, 12);
  ASSERT_EQ(bitmap.height, 9);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 12; ++x) {
      const std::uint8_t* rgba = bitmap.rgba.data() + std::size_t(4) * std::size_t(y * 12 + x);
      const bool inside = x >= 2 && y >= 2 && x < 10 && y < 7;
      ASSERT_EQ(rgba[3], inside ? 255 : 0);
      ASSERT_NEAR(rgba[0], inside ? expected(0.01 * x + 0.02 * y) : 0, 1);
    }
  }
}

TEST_F(ExrTest, WhatIsBrokenIsNamed) {
  const auto whole = bytes_of({40, 30, 0, false}, {"R", "G", "B"}, light);
  for (const double share : {0.02, 0.3, 0.6, 0.99}) {
    const auto end = whole.begin() + std::ptrdiff_t(share * double(whole.size()));
    EXPECT_THAT(message_of({whole.begin(), end}), HasSubstr("frame_7.exr"));
  }
  EXPECT_THAT(message_of({}), HasSubstr("frame_7.exr"));
  EXPECT_THAT(message_of(bytes_of({4, 4, 0, false}, {"Z", "view.R"}, light)),
              HasSubstr("it has Z, view.R. Save it as OpenEXR of one layer"));
  // The windows say more than the file could hold.
  auto huge = whole;
  const std::string text(reinterpret_cast<const char*>(whole.data()), whole.size());
  const std::size_t at = text.find("dataWindow");
  ASSERT_NE(at, std::string::npos);
  huge[at + 11 + 6 + 4 + 8 + 2] = std::byte{0x0f};  // x1, its third byte
  EXPECT_THAT(message_of(huge), HasSubstr("its data window is"));
  auto deep = whole;
  deep[5] = std::byte{0x08};
  EXPECT_THAT(message_of(deep), HasSubstr("several parts or of deep pixels"));
}

TEST(Srgb, BothWaysGiveTheSame) {
  for (int i = 0; i < 256; ++i) {
    EXPECT_EQ(byte_of_linear(linear_of_bytes()[std::size_t(i)]), i);
  }
  EXPECT_NEAR(linear_of_srgb(0.5), 0.21404, 1e-5);
  EXPECT_NEAR(srgb_of_linear(linear_of_srgb(0.3)), 0.3, 1e-12);
}

}  // namespace
}  // namespace matterfit::capture
