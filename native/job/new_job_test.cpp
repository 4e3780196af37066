// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/new_job.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/folder_for_test.hpp"
#include "base/message_for_test.hpp"
#include "capture/npz.hpp"
#include "job/documents/document.hpp"
#include "job/documents/fit_document.hpp"
#include "job/run/capture_input.hpp"

namespace matterfit::job {
namespace {

using capture::Array;
using capture::Arrays;
using ::testing::HasSubstr;

/// A cube of 0.2 m whose eight corners fall; corner 5 is hidden in the first two of six frames.
struct FallingCube {
  std::vector<double> positions;
  std::vector<std::uint8_t> visible;
  std::vector<double> times;
  std::vector<std::int32_t> faces;

  FallingCube() {
    for (int frame = 0; frame < 6; ++frame) {
      const double t = frame / 30.0;
      times.push_back(t);
      for (int i = 0; i < 8; ++i) {
        positions.push_back(0.2 * (i & 1) + 0.3 * t);
        positions.push_back(0.2 * (i >> 1 & 1));
        positions.push_back(0.5 + 0.2 * (i >> 2 & 1) - 4.905 * t * t);
        visible.push_back(i == 5 && frame < 2 ? 0 : 1);
      }
    }
    faces = {0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5};
  }

  void write(const std::filesystem::path& path, bool with_faces) const {
    Arrays arrays;
    arrays.emplace("positions", Array({6, 8, 3}, positions));
    arrays.emplace("visible", Array({6, 8}, visible));
    arrays.emplace("times", Array({6}, times));
    if (with_faces) arrays.emplace("faces", Array({6, 4}, faces));
    capture::write_npz(path, arrays);
  }
};

NewJobOptions options_in(const Folder& folder) {
  NewJobOptions options;
  options.capture = folder.path / "cube.npz";
  options.output = folder.path / "cube.json";
  return options;
}

TEST(NewJob, MeshOfTheFileBecomesTheBody) {
  const Folder folder;
  FallingCube().write(folder.path / "cube.npz", true);
  NewJobOptions options = options_in(folder);
  options.ground = 0.1;
  options.friction = 0.5;
  options.density = 900.0;
  options.noise = 5e-4;
  options.law = material::Law::kVonMises;
  write_new_job(options);
  const Job job = read_job_file(options.output);
  ASSERT_EQ(job.scene.bodies.size(), 1U);
  EXPECT_EQ(job.scene.bodies.front().density, 900.0);
  EXPECT_EQ(job.scene.bodies.front().material.law, material::Law::kVonMises);
  EXPECT_NEAR(job.scene.fps, 30.0, 1e-9);
  EXPECT_EQ(job.scene.end_frame, 6);
  ASSERT_EQ(job.scene.colliders.size(), 1U);
  EXPECT_EQ(job.scene.colliders.front().height, 0.1);
  EXPECT_EQ(job.scene.colliders.front().contact.mu, 0.5);
  // 0.008 m³ in 4000 particles at most.
  EXPECT_GT(job.scene.particle_separation, 0.0124);
  EXPECT_LT(job.scene.particle_separation, 0.02);
  ASSERT_TRUE(job.fit);
  EXPECT_EQ(job.fit->parameters.size(), 5U);  // velocity, spin, E, nu, yield stress
  EXPECT_TRUE(std::filesystem::exists(folder.path / "cube_body.ply"));
}

TEST(NewJob, HiddenPointsAreTakenBackByTheirFramesMotion) {
  const Folder folder;
  FallingCube().write(folder.path / "cube.npz", true);
  const NewJobOptions options = options_in(folder);
  write_new_job(options);
  const Job job = read_job_file(options.output);
  const auto& places = job.captures.front().positions;
  ASSERT_EQ(places.size(), 8U);
  EXPECT_LT((places[5] - Vec3d(0.2, 0.0, 0.7)).norm(), 1e-9);
}

TEST(NewJob, WithoutFacesTheHullIsFilled) {
  const Folder folder;
  FallingCube().write(folder.path / "cube.npz", false);
  write_new_job(options_in(folder));
  EXPECT_TRUE(std::filesystem::exists(folder.path / "cube_body.npz"));
  EXPECT_FALSE(std::filesystem::exists(folder.path / "cube_body.ply"));
}

/// What a clock says before the first sample is the recorder's affair.
TEST(NewJob, TheSceneBeginsWithTheFirstSample) {
  const auto written = [](const Folder& folder, double clock) {
    FallingCube cube;
    for (double& time : cube.times) time += clock;
    cube.write(folder.path / "cube.npz", true);
    return write_new_job(options_in(folder));
  };
  const Folder plain;
  EXPECT_TRUE(written(plain, 0.0).empty());
  const Job job = read_job_file(options_in(plain).output);
  EXPECT_FALSE(job.captures.front().start_frame);
  const std::vector<double> times = load_capture(job, 0, false).tracks.times;
  for (const double clock : {2.5, -1.0, 0.2 / 30.0}) {  // the last a fifth of a frame
    const Folder folder;
    const std::vector<std::string> statements = written(folder, clock);
    ASSERT_EQ(statements.size(), 1U);
    EXPECT_THAT(statements.front(), HasSubstr("start_frame"));
    const Job shifted = read_job_file(options_in(folder).output);
    EXPECT_NEAR(shifted.captures.front().start_frame.value_or(0.0), -30.0 * clock, 1e-9);
    EXPECT_NEAR(shifted.scene.fps, job.scene.fps, 1e-9);
    EXPECT_EQ(shifted.scene.end_frame, job.scene.end_frame);
    EXPECT_EQ(shifted.captures.front().positions, job.captures.front().positions);
    const std::vector<double> there = load_capture(shifted, 0, false).tracks.times;
    ASSERT_EQ(there.size(), times.size());
    for (std::size_t t = 0; t < times.size(); ++t) EXPECT_NEAR(there[t], times[t], 1e-12);
    auto document = [](Json json) {
      json["captures"][0].erase("start_frame");
      json["scene"].erase("fps");
      return json;
    };
    EXPECT_EQ(document(shifted.document), document(job.document));
  }
}

TEST(NewJob, NamesWhatIsWrong) {
  const Folder folder;
  FallingCube cube;
  cube.faces[3] = 8;
  cube.write(folder.path / "cube.npz", true);
  EXPECT_THAT(message_of([&] { write_new_job(options_in(folder)); }),
              HasSubstr("cube.npz: 'faces' names vertex 8"));
  EXPECT_FALSE(std::filesystem::exists(folder.path / "cube.json"));

  Arrays arrays;
  arrays.emplace("positions", Array({2, 8, 3}, std::vector<double>(48, 0.0)));
  arrays.emplace("times", Array({2}, std::vector<double>{0.0, 0.1}));
  capture::write_npz(folder.path / "cube.npz", arrays);
  EXPECT_THAT(message_of([&] { write_new_job(options_in(folder)); }), HasSubstr("has 2 frames"));
  NewJobOptions published = options_in(folder);
  published.law = material::Law::kPublished;
  EXPECT_THAT(message_of([&] { write_new_job(published); }), HasSubstr("the law neural has no"));
}

}  // namespace
}  // namespace matterfit::job
