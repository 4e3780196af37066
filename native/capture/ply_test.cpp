// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/ply.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <cstring>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "capture/bytes_for_test.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string ply_header(const std::string& format) {
  return "ply\nformat " + format +
         " 1.0\ncomment made by hand\nelement vertex 2\nproperty float x\nproperty double y\n"
         "property short z\nelement face 2\nproperty uchar red\n"
         "property list uchar int vertex_indices\nend_header\n";
}

template <class T>
void put(std::string& out, T value, bool big) {
  std::string raw(sizeof(T), '\0');
  std::memcpy(raw.data(), &value, sizeof(T));
  if (big) raw = std::string(raw.rbegin(), raw.rend());
  out += raw;
}

std::string binary(bool big) {
  std::string out = ply_header(big ? "binary_big_endian" : "binary_little_endian");
  for (const double row : {0.0, 10.0}) {
    put(out, static_cast<float>(row + 0.5), big);
    put(out, row + 0.25, big);
    put(out, static_cast<std::int16_t>(-row - 1), big);
  }
  put(out, std::uint8_t{200}, big);
  put(out, std::uint8_t{3}, big);
  for (const std::int32_t i : {0, 1, -7}) put(out, i, big);
  put(out, std::uint8_t{7}, big);
  put(out, std::uint8_t{1}, big);
  put(out, std::int32_t{70000}, big);
  return out;
}

void expect_sample(const Ply& ply) {
  EXPECT_THAT(ply.comments, ElementsAre("made by hand"));
  EXPECT_THAT(ply_positions(ply, "a.ply"), ElementsAre(0.5, 0.25, -1, 10.5, 10.25, -11));
  const PlyElement* face = ply.find("face");
  ASSERT_NE(face, nullptr);
  EXPECT_EQ(face->count, 2U);
  EXPECT_THAT(face->find("red")->integers(), ElementsAre(200, 7));
  EXPECT_THAT(face->find("vertex_indices")->sizes, ElementsAre(3, 1));
  EXPECT_THAT(face->find("vertex_indices")->integers(), ElementsAre(0, 1, -7, 70000));
  EXPECT_EQ(face->find("green"), nullptr);
}

TEST(PlyTest, ThreeFormatsGiveTheSame) {
  expect_sample(parse_ply(bytes_of(binary(false)), "a.ply"));
  expect_sample(parse_ply(bytes_of(binary(true)), "a.ply"));
  expect_sample(parse_ply(bytes_of(ply_header("ascii") + "0.5 .25 -1\n10.5 1.025e1 -11\n"
                                                         "200 3 0 1 -7\n7 1 70000"),
                          "a.ply"));
}

TEST(PlyTest, CarriageReturnsAndExtremeNumbers) {
  const Ply ply =
      parse_ply(bytes_of("ply\r\nformat ascii 1.0\r\nelement vertex 1\r\nproperty float x\r\n"
                         "property float y\r\nproperty float z\r\nend_header\r\n+1 1e-400 nan\r\n"),
                "a.ply");
  const auto p = ply_positions(ply, "a.ply");
  EXPECT_EQ(p[0], 1.0);
  EXPECT_EQ(p[1], 0.0);
  EXPECT_TRUE(std::isnan(p[2]));
}

TEST(PlyTest, EveryTruncationIsAnError) {
  for (const std::string& whole : {binary(false), binary(true)}) {
    for (std::size_t n = 0; n < whole.size(); ++n) {
      EXPECT_THROW((void)parse_ply(bytes_of(whole).first(n), "cut.ply"), Error) << n;
    }
  }
}

TEST(PlyTest, HostileCountsAreRefusedBeforeMemoryIsTaken) {
  const auto refuse = [](const std::string& text, const char* words) {
    EXPECT_THAT(message_of([&] { (void)parse_ply(bytes_of(text), "x.ply"); }), HasSubstr(words))
        << text;
  };
  const std::string start = "ply\nformat binary_little_endian 1.0\n";
  refuse(start + "element vertex 4000000000\nproperty float x\nend_header\n1234",
         "states 4000000000 rows");
  refuse(start + "element vertex 18446744073709551615\nproperty double x\nend_header\n1234",
         "but only 4 bytes follow");
  refuse(start + "element vertex 18446744073709551616\nproperty double x\nend_header\n",
         "no count");
  refuse(start + "element f 1\nproperty list uint double v\nend_header\n\xFF\xFF\xFF\xFF",
         "Is it truncated?");
  refuse(start + "element f 1\nproperty list char int v\nend_header\n\xFF", "length -1");
  refuse(start + "element f 1\nproperty list float int v\nend_header\n", "of a list's count");
  refuse(start + "property float x\nend_header\n", "before the first element");
  refuse("ply\nformat ascii 1.0\nelement f 1\nproperty list int int v\nend_header\n2000000000 1",
         "line 6: a list is longer than the file");
  refuse("ply\nformat ascii 1.0\nelement v 1\nproperty uchar v\nend_header\n256\n", "does not fit");
  refuse("ply\nformat ascii 1.0\nelement v 1\nproperty float v\nend_header\nabc\n",
         "line 6: 'abc' is not a number");
  refuse("ply\nformat ascii 2.0\n", "version 1.0");
  refuse("solid cube", "does not end");
}

TEST(PlyTest, MissingCoordinatesAreNamed) {
  const Ply ply = parse_ply(
      bytes_of("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"),
      "a.ply");
  EXPECT_THAT(message_of([&] { (void)ply_positions(ply, "a.ply"); }),
              HasSubstr("a.ply: the element 'vertex' has no property 'y'"));
}

TEST(PlyTest, PointsRoundTripBitForBit) {
  const fs::path path =
      fs::temp_directory_path() / ("matterfit_ply_test_" + std::to_string(::getpid()) + ".ply");
  std::vector<float> x(300001);
  std::vector<float> f(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = static_cast<float>(i) * 0.1F;
    f[i] = std::bit_cast<float>(static_cast<std::uint32_t>(i * 7919));
  }
  const std::vector<PlyColumn> columns = {{"x", x}, {"f_rest_0", f}};
  const std::vector<std::string> comments = {"two\nlines"};
  write_ply_points(path, columns, comments);
  const Ply ply = read_ply(path);
  fs::remove(path);
  EXPECT_THAT(ply.comments, ElementsAre("two lines"));
  const PlyElement* vertex = ply.find("vertex");
  ASSERT_NE(vertex, nullptr);
  EXPECT_EQ(vertex->find("x")->floats(), x);
  EXPECT_EQ(0, std::memcmp(vertex->find("f_rest_0")->floats().data(), f.data(), f.size() * 4));
}

}  // namespace
}  // namespace matterfit::capture
