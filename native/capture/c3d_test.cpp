// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/c3d.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "capture/bytes_for_test.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Writes small C3D files in the byte order and number format of each processor type.
struct Writer {
  int processor = 84;
  bool floating = true;
  float scale = 0.5F;
  std::string units = "mm";
  std::vector<std::pair<std::string, std::vector<int>>> trial;  ///< TRIAL parameters, 16-bit words
  int header_last = 2;
  int analog = 0;

  void put_word(std::string& out, int value) const {
    const auto bits = static_cast<std::uint16_t>(value);
    const auto low = static_cast<char>(bits & 0xFFU);
    const auto high = static_cast<char>(bits >> 8U);
    out += processor == 86 ? std::string{high, low} : std::string{low, high};
  }
  void put_float(std::string& out, float value) const {
    if (processor == 85) value *= 4.0F;  // DEC's exponent is larger by two for the same value.
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, 4);
    const auto at = [&](unsigned i) { return static_cast<char>((bits >> (8U * i)) & 0xFFU); };
    if (processor == 84) out += std::string{at(0), at(1), at(2), at(3)};
    if (processor == 85) out += std::string{at(2), at(3), at(0), at(1)};
    if (processor == 86) out += std::string{at(3), at(2), at(1), at(0)};
  }
  void put_record(std::string& out, int group, const std::string& name,
                  const std::string& body) const {
    out.push_back(static_cast<char>(name.size()));
    out.push_back(static_cast<char>(group));
    out += name;
    put_word(out, static_cast<int>(body.size()) + 2);
    out += body;
  }
  [[nodiscard]] std::string format(
      const std::vector<std::vector<std::array<float, 4>>>& frames) const {
    const int points = static_cast<int>(frames[0].size());
    std::string header;
    header += "\x02\x50";
    put_word(header, points);
    put_word(header, analog);
    put_word(header, 1);
    put_word(header, header_last);
    put_word(header, 10);
    put_float(header, floating ? -scale : scale);
    put_word(header, 3);
    put_word(header, 0);
    put_float(header, 120.0F);
    header.resize(512, '\0');

    std::string section{'\1', '\x50', '\1', static_cast<char>(processor)};
    const std::string description(1, '\0');
    put_record(section, -1, "POINT", description);
    put_record(section, -2, "TRIAL", description);
    std::string labels{'\xFF', '\2', '\4', static_cast<char>(points)};
    for (int i = 0; i < points; ++i) labels += "M" + std::to_string(i) + "  ";
    put_record(section, 1, "LABELS", labels + description);
    put_record(section, 1, "UNITS",
               std::string{'\xFF', '\1', static_cast<char>(units.size())} + units + description);
    for (const auto& [name, values] : trial) {
      std::string body{'\2', '\1', static_cast<char>(values.size())};
      for (const int value : values) put_word(body, value);
      put_record(section, 2, name, body + description);
    }
    section += std::string(2, '\0');
    section.resize(512, '\0');

    std::string data;
    for (const auto& frame : frames) {
      for (const auto& point : frame) {
        for (const float value : point) {
          if (floating) {
            put_float(data, value);
          } else {
            put_word(data, static_cast<int>(value));
          }
        }
      }
      for (int i = 0; i < analog; ++i) {
        if (floating) {
          put_float(data, 9999.0F);
        } else {
          put_word(data, 9999);
        }
      }
    }
    return header + section + data;
  }
};

const std::vector<std::vector<std::array<float, 4>>> kFrames = {
    {{10, 20, -30, 2}, {1, 2, 3, -1}}, {{11, 21, -31, 0}, {4, 5, 6, 0x0103}}};

// Integer points are scaled, float points are not; the fourth word says what was seen.
TEST(C3dTest, EveryProcessorAndNumberFormat) {
  for (const int processor : {84, 85, 86}) {
    for (const bool floating : {true, false}) {
      for (const int analog : {0, 3}) {
        SCOPED_TRACE(testing::Message() << processor << ' ' << floating << ' ' << analog);
        Writer writer;
        writer.processor = processor;
        writer.floating = floating;
        writer.analog = analog;
        const C3d file = parse_c3d(bytes_of(writer.format(kFrames)), "a.c3d");
        const double scale = floating ? 1.0 : 0.5;
        ASSERT_EQ(file.points, 2U);
        ASSERT_EQ(file.frames, 2U);
        EXPECT_EQ(file.rate, 120.0);
        EXPECT_EQ(file.units, "mm");
        EXPECT_EQ(file.metres_per_unit(), 0.001);
        EXPECT_THAT(file.labels, ElementsAre("M0", "M1"));
        EXPECT_EQ(file.positions[0], Vec3d(10, 20, -30) * scale);
        EXPECT_EQ(file.positions[3], Vec3d(4, 5, 6) * scale);
        EXPECT_THAT(file.visible, ElementsAre(1, 0, 1, 1));
        EXPECT_TRUE(std::isnan(file.positions[1].x()));
        EXPECT_THAT(file.residuals, ElementsAre(1.0F, -1.0F, 0.0F, 1.5F));
      }
    }
  }
}

// More frames than the header's 16 bits hold: the count comes from TRIAL's pairs of words.
TEST(C3dTest, LongTrialsCountByTrialFields) {
  const std::size_t frames = 70000;
  Writer writer;
  writer.header_last = 65535;
  writer.trial = {
      {"ACTUAL_START_FIELD", {1, 0}},
      {"ACTUAL_END_FIELD", {static_cast<int>(frames) & 0xFFFF, static_cast<int>(frames) >> 16}}};
  const C3d file = parse_c3d(bytes_of(writer.format(std::vector<std::vector<std::array<float, 4>>>(
                                 frames, {{1, 2, 3, 0}}))),
                             "long.c3d");
  EXPECT_EQ(file.frames, frames);
  EXPECT_EQ(file.positions.back(), Vec3d(1, 2, 3));
}

TEST(C3dTest, EveryTruncationIsAnError) {
  const std::string whole = Writer().format(kFrames);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    EXPECT_THROW((void)parse_c3d(bytes_of(whole).first(n), "cut.c3d"), Error) << n;
  }
  EXPECT_THAT(
      message_of([&] { (void)parse_c3d(bytes_of(whole).first(1050), "cut.c3d"); }),
      HasSubstr("cut.c3d: states 2 frames of 32 bytes, but only 26 bytes follow at byte 1024"));
}

TEST(C3dTest, ForeignFilesAreRefusedInWords) {
  EXPECT_THAT(message_of([] { (void)parse_c3d(bytes_of(std::string(600, 'x')), "x.c3d"); }),
              HasSubstr("not a C3D file"));
  std::string odd = Writer().format(kFrames);
  odd[512 + 3] = 99;
  EXPECT_THAT(message_of([&] { (void)parse_c3d(bytes_of(odd), "x.c3d"); }),
              HasSubstr("processor type 99"));
}

struct Recording {
  const char* file;
  std::size_t frames;
  std::size_t release;
  std::array<double, 3> sag_mm;  ///< Tip-1..3 along marker −x, as the data's own notes give them
};

// The silicone beam: last second minus the quiet time before release.
TEST(C3dTest, BeamRecordings) {
  const fs::path folder = fs::path(MATTERFIT_DATA_DIR) / "beam";
  if (!fs::exists(folder)) GTEST_SKIP() << "no beam recordings at " << folder;
  const std::vector<Recording> recordings = {
      {"beam_gravity_V2_a.c3d", 500, 71, {6.63, 6.52, 6.22}},
      {"beam_gravity_V2_b.c3d", 500, 65, {6.72, 6.59, 6.30}},
      {"beam_load52_V2_a.c3d", 600, 43, {17.45, 17.31, 15.95}}};
  for (const Recording& recording : recordings) {
    SCOPED_TRACE(recording.file);
    const C3d file = read_c3d(folder / recording.file);
    ASSERT_EQ(file.points, 6U);
    ASSERT_EQ(file.frames, recording.frames);
    EXPECT_EQ(file.rate, 100.0);
    EXPECT_EQ(file.units, "m");
    EXPECT_THAT(file.labels,
                ElementsAre("Tip - 1", "Tip - 2", "Tip - 3", "Base - 1", "Base - 2", "Base - 3"));
    for (std::size_t tip = 0; tip < 3; ++tip) {
      const auto mean_x = [&](std::size_t begin, std::size_t end) {
        double sum = 0.0;
        for (std::size_t frame = begin; frame < end; ++frame) {
          EXPECT_EQ(file.visible[frame * 6 + tip], 1);
          sum += file.positions[frame * 6 + tip].x();
        }
        return sum / static_cast<double>(end - begin);
      };
      const double quiet = mean_x(0, recording.release - 5);
      const double settled = mean_x(recording.frames - 100, recording.frames);
      // Printed to .01 mm; where exactly the quiet time ends is worth as much again.
      EXPECT_NEAR((quiet - settled) * 1e3, recording.sag_mm[tip], 0.015) << "Tip-" << tip + 1;
    }
  }
}

}  // namespace
}  // namespace matterfit::capture
