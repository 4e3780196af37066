// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/pc2.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "base/error.hpp"
#include "capture/bytes_for_test.hpp"

namespace matterfit::capture {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

template <class T>
void put(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string pc2_header(std::int32_t points, std::int32_t samples, float rate = 1.0F,
                       std::int32_t version = 1) {
  std::string out("POINTCACHE2\0", 12);
  put(out, version);
  put(out, points);
  put(out, 5.0F);
  put(out, rate);
  put(out, samples);
  return out;
}

std::string refusal_of_pc2(const std::string& text) {
  try {
    (void)parse_pc2(bytes_of(text), "a.pc2");
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

TEST(Pc2Test, ReadsWhatTheHeaderSays) {
  std::string file = pc2_header(1, 2, 0.5F);
  for (const float value : {1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F}) put(file, value);
  const PointCache cache = parse_pc2(bytes_of(file), "a.pc2");
  EXPECT_EQ(cache.points, 1U);
  EXPECT_EQ(cache.samples, 2U);
  EXPECT_EQ(cache.start_frame, 5.0F);
  EXPECT_EQ(cache.sample_rate, 0.5F);
  EXPECT_THAT(cache.positions, ElementsAre(1, 2, 3, 4, 5, 6));
  for (std::size_t n = 0; n < file.size(); ++n) {
    EXPECT_THROW((void)parse_pc2(bytes_of(file).first(n), "cut.pc2"), Error) << n;
  }
  EXPECT_THAT(refusal_of_pc2(file + "x"), HasSubstr("25 bytes follow the header"));
}

TEST(Pc2Test, HostileHeaders) {
  constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
  EXPECT_THAT(refusal_of_pc2(pc2_header(kMost, kMost)), HasSubstr("truncated"));
  EXPECT_THAT(refusal_of_pc2(pc2_header(-1, 1)), HasSubstr("must be positive"));
  EXPECT_THAT(refusal_of_pc2(pc2_header(1, 0)), HasSubstr("must be positive"));
  EXPECT_THAT(refusal_of_pc2(pc2_header(1, 1, std::numeric_limits<float>::quiet_NaN())),
              HasSubstr("sample rate"));
  EXPECT_THAT(refusal_of_pc2(pc2_header(1, 1, 1.0F, 7)), HasSubstr("version 7"));
  EXPECT_THAT(refusal_of_pc2(std::string(40, 'x')), HasSubstr("is not a PC2 point cache"));
}

}  // namespace
}  // namespace matterfit::capture
