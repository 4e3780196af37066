// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/tracks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "capture/npz.hpp"
#include "capture/ply.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const double kNan = std::numeric_limits<double>::quiet_NaN();

class TracksTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("matterfit_tracks_test_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path cloud(const std::string& name, const std::vector<float>& x) {
    const std::vector<float> zero(x.size(), 0.0F);
    const std::vector<PlyColumn> columns = {{"x", x}, {"y", zero}, {"z", zero}};
    write_ply_points(folder_ / name, columns);
    return folder_ / name;
  }
  fs::path npz(const Arrays& arrays) {
    write_npz(folder_ / "capture.npz", arrays);
    return folder_ / "capture.npz";
  }
  fs::path folder_;
};

Arrays sample_tracks() {
  Arrays arrays;
  arrays.emplace("positions",
                 Array({2, 2, 3}, std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
  arrays.emplace("times", Array({2}, std::vector<double>{0.5, 0.75}));
  arrays.emplace("noise", Array({2}, std::vector<double>{0.1, 0.2}));
  arrays.emplace("labels", Array({2}, std::vector<std::string>{"Tip - 1", "Base"}));
  return arrays;
}

TEST_F(TracksTest, NpzWithEveryKey) {
  Arrays arrays = sample_tracks();
  arrays.emplace("visible", Array({2, 2}, std::vector<std::uint8_t>{1, 0, 1, 1}));
  arrays.emplace("up", Array({}, std::vector<std::string>{"y"}));
  const Tracks tracks = read_tracks(npz(arrays));
  ASSERT_EQ(tracks.points, 2U);
  EXPECT_THAT(tracks.times, ElementsAre(0.5, 0.75));
  EXPECT_THAT(tracks.visible, ElementsAre(1, 0, 1, 1));
  EXPECT_EQ(tracks.position(0, 0), Vec3d(1, -3, 2)) << "y up becomes z up by a turn about x";
  EXPECT_TRUE(std::isnan(tracks.position(0, 1).x()));
  EXPECT_EQ(tracks.position(1, 1), Vec3d(10, -12, 11));
  EXPECT_THAT(tracks.noise, ElementsAre(0.1, 0.2));
  EXPECT_THAT(tracks.labels, ElementsAre("Tip - 1", "Base"));
}

TEST_F(TracksTest, UnitUpTransformAndMarkersApplyInThisOrder) {
  TracksOptions options;
  options.unit = 0.001;
  options.up = 'x';
  options.transform.topRightCorner<3, 1>() = Vec3d(10, 20, 30);
  options.transform.topLeftCorner<3, 3>() *= 2.0;
  options.markers = {"base", "tip-1"};
  const Tracks tracks = read_tracks(npz(sample_tracks()), options);
  EXPECT_THAT(tracks.labels, ElementsAre("Base", "Tip - 1"));
  // (4, 5, 6) mm, x up: (−6, 5, 4) mm, twice as large, then moved.
  EXPECT_LT((tracks.position(0, 0) - Vec3d(9.988, 20.010, 30.008)).norm(), 1e-12);
  ASSERT_EQ(tracks.noise.size(), 2U);
  EXPECT_NEAR(tracks.noise[0], 0.2 * 0.002, 1e-15);
  options.up = 'd';  // (4, 5, 6) mm, y down: (4, 6, −5) mm
  EXPECT_LT(
      (read_tracks(npz(sample_tracks()), options).position(0, 0) - Vec3d(10.008, 20.012, 29.99))
          .norm(),
      1e-12);
  options.up = 'x';
  options.markers = {"1"};
  options.noise = {5e-4};
  const Tracks one = read_tracks(npz(sample_tracks()), options);
  EXPECT_THAT(one.labels, ElementsAre("Base"));
  EXPECT_THAT(one.noise, ElementsAre(5e-4));
}

TEST_F(TracksTest, NotANumberIsNotVisibleUnlessTheFileSaysSo) {
  Arrays arrays = sample_tracks();
  auto& values = std::get<std::vector<double>>(arrays.at("positions").data);
  values[4] = kNan;
  EXPECT_THAT(read_tracks(npz(arrays)).visible, ElementsAre(1, 0, 1, 1));
  arrays.emplace("visible", Array({2, 2}, std::vector<std::uint8_t>{1, 1, 1, 1}));
  EXPECT_THAT(message_of([&] { (void)read_tracks(npz(arrays)); }),
              HasSubstr("point 1 at frame 0 is visible but its position is not finite"));
  values.assign(12, kNan);
  arrays.erase("visible");
  EXPECT_THAT(message_of([&] { (void)read_tracks(npz(arrays)); }),
              HasSubstr("no point is visible"));
}

TEST_F(TracksTest, WrongArraysAreNamed) {
  const auto refuse = [&](const char* key, const Array& array, const char* words) {
    Arrays arrays = sample_tracks();
    arrays.insert_or_assign(key, array);
    EXPECT_THAT(message_of([&] { (void)read_tracks(npz(arrays)); }), HasSubstr(words));
  };
  refuse("positions", Array({2, 6}, std::vector<double>(12)),
         "capture.npz: 'positions' has shape (2, 6), expected (frames, points, 3). Was it saved "
         "without reshape?");
  refuse("positions", Array({0, 2, 3}, std::vector<double>()), "which is empty");
  refuse("times", Array({3}, std::vector<double>{0, 1, 2}),
         "'times' has shape (3,), expected (2,)");
  refuse("times", Array({2}, std::vector<double>{1, 1}), "frame 1 is at 1.000000 s, not after");
  refuse("times", Array({2}, std::vector<double>{0, kNan}), "time of frame 1 is not finite");
  refuse("visible", Array({2}, std::vector<std::uint8_t>{1, 1}), "expected (2, 2)");
  refuse("noise", Array({2}, std::vector<double>{1, -1}), "standard deviations");
  refuse("labels", Array({1}, std::vector<std::string>{"a"}), "'labels'");
  refuse("up", Array({}, std::vector<std::string>{"w"}), "up axis of a capture is 'w'");
  TracksOptions options;
  options.markers = {"Tip - 9"};
  EXPECT_THAT(message_of([&] { (void)read_tracks(npz(sample_tracks()), options); }),
              HasSubstr("no marker 'Tip - 9'; it has Tip - 1, Base, indices 0 to 1"));
  options.markers = {"Base", "1"};
  EXPECT_THAT(message_of([&] { (void)read_tracks(npz(sample_tracks()), options); }),
              HasSubstr("twice"));
  options = {};
  options.transform(0, 0) = 0.0;
  EXPECT_THAT(message_of([&] { (void)read_tracks(npz(sample_tracks()), options); }),
              HasSubstr("regular"));
}

TEST_F(TracksTest, FilesWithoutTimesNeedFramesPerSecond) {
  Arrays arrays = sample_tracks();
  arrays.erase("times");
  EXPECT_THAT(message_of([&] { (void)read_tracks(npz(arrays)); }), HasSubstr("frames per second"));
  write_file(folder_ / "p.npy", format_npy(arrays.at("positions")));
  TracksOptions options;
  options.fps = 50.0;
  EXPECT_THAT(read_tracks(folder_ / "p.npy", options).times, ElementsAre(0.0, 0.02));
}

// Numbers are times: a missing file is a gap, not a shorter clip.
TEST_F(TracksTest, NumberedPly) {
  cloud("other_0001.ply", {9, 9, 9});
  cloud("cloud_0010.ply", {3, 4});
  cloud("cloud_0007.ply", {1, 2});
  cloud("cloud_0008.ply", {2, 3});
  TracksOptions options;
  options.fps = 10.0;
  for (const char* name : {"cloud_####.ply", "cloud_0007.ply"}) {
    const Tracks tracks = read_tracks(folder_ / name, options);
    ASSERT_EQ(tracks.frames(), 3U) << name;
    EXPECT_NEAR(tracks.times[1], 0.1, 1e-12);
    EXPECT_NEAR(tracks.times[2], 0.3, 1e-12);
    EXPECT_EQ(tracks.position(2, 1).x(), 4.0);
  }
  EXPECT_THAT(message_of([&] { (void)read_tracks(folder_, options); }),
              HasSubstr("more than one sequence of .ply files (cloud_#.ply, other_#.ply)"));
  EXPECT_THAT(message_of([&] { (void)read_tracks(folder_ / "c_##.ply", options); }),
              HasSubstr("no file matches"));
  EXPECT_THAT(message_of([&] { (void)read_tracks(folder_ / "c_#_#.ply", options); }),
              HasSubstr("one run of #"));
  EXPECT_THAT(message_of([&] { (void)read_tracks(folder_ / "none.ply", options); }),
              HasSubstr("no such file"));
  fs::remove(folder_ / "other_0001.ply");
  EXPECT_EQ(read_tracks(folder_, options).frames(), 3U);

  cloud("cloud_10.ply", {3, 4});
  EXPECT_THAT(message_of([&] { (void)read_tracks(folder_, options); }),
              HasSubstr("the same frame number"));
  EXPECT_EQ(read_tracks(folder_ / "cloud_####.ply", options).frames(), 3U);
  fs::remove(folder_ / "cloud_10.ply");

  cloud("cloud_0011.ply", {3, 4, 5});
  EXPECT_THAT(message_of([&] { (void)read_tracks(folder_, options); }),
              HasSubstr("cloud_0011.ply: has 3 points, cloud_0007.ply has 2"));
  const PointCloudSequence clouds = read_point_clouds(folder_, options);
  EXPECT_EQ(clouds.frames.size(), 4U);
  EXPECT_EQ(clouds.frames[0].size(), 2U);
  ASSERT_EQ(clouds.frames[3].size(), 3U);
  EXPECT_EQ(clouds.frames[3][2].x(), 5.0);

  options.clouds = true;
  cloud("cloud_0009.ply", {});
  const Tracks padded = read_tracks(folder_, options);
  ASSERT_EQ(padded.points, 3U);
  ASSERT_EQ(padded.frames(), 5U);
  EXPECT_THAT(padded.visible, ElementsAre(1, 1, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 1, 1, 1));
  EXPECT_EQ(padded.position(4, 2).x(), 5.0);
}

TEST_F(TracksTest, PointCloudsInOneNpz) {
  Arrays arrays;
  arrays.emplace("points", Array({3, 3}, std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  arrays.emplace("counts", Array({2}, std::vector<std::int64_t>{1, 2}));
  arrays.emplace("times", Array({2}, std::vector<double>{0, 1}));
  const PointCloudSequence clouds = read_point_clouds(npz(arrays));
  ASSERT_EQ(clouds.frames.size(), 2U);
  EXPECT_EQ(clouds.frames[1][1], Vec3d(7, 8, 9));
  arrays.insert_or_assign("counts", Array({2}, std::vector<std::int64_t>{1, 3}));
  EXPECT_THAT(message_of([&] { (void)read_point_clouds(npz(arrays)); }), HasSubstr("add up"));
}

TEST_F(TracksTest, PointCache) {
  std::string file("POINTCACHE2\0", 12);
  const auto put = [&](auto value) {
    file.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  put(std::int32_t{1});
  put(std::int32_t{1});
  put(3.0F);
  put(0.5F);
  put(std::int32_t{2});
  for (const float value : {1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F}) put(value);
  write_file(folder_ / "a.pc2", file);
  TracksOptions options;
  options.fps = 25.0;
  const Tracks tracks = read_tracks(folder_ / "a.pc2", options);
  EXPECT_THAT(tracks.times, ElementsAre(0.0, 0.02));
  EXPECT_EQ(tracks.position(1, 0), Vec3d(4, 5, 6));
  EXPECT_THAT(message_of([&] { (void)read_tracks(folder_ / "a.pc2"); }),
              HasSubstr("frames per second"));
}

TEST_F(TracksTest, BeamRecordingByMarkerName) {
  const fs::path path = fs::path(MATTERFIT_DATA_DIR) / "beam" / "beam_gravity_V2_a.c3d";
  if (!fs::exists(path)) GTEST_SKIP() << "no beam recording at " << path;
  TracksOptions options;
  options.markers = {"Tip-1", "Tip-2", "Tip-3"};
  const Tracks tracks = read_tracks(path, options);
  EXPECT_EQ(tracks.points, 3U);
  EXPECT_EQ(tracks.frames(), 500U);
  EXPECT_NEAR(tracks.times.back(), 4.99, 1e-12);
  EXPECT_NEAR(tracks.position(0, 0).z(), 0.075, 0.005) << "metres, tip along z";
}

TEST_F(TracksTest, CapturesOfOtherSimulators) {
  const fs::path path = fs::path(MATTERFIT_DATA_DIR) / "other_simulators" / "sand_cube.npz";
  if (!fs::exists(path)) GTEST_SKIP() << "no capture at " << path;
  const Tracks tracks = read_tracks(path);
  EXPECT_EQ(tracks.frames(), 18U);
  EXPECT_EQ(tracks.points, 2000U);
  EXPECT_NEAR(tracks.times[1] - tracks.times[0], 1.0 / 24.0, 1e-6);
}

}  // namespace
}  // namespace matterfit::capture
