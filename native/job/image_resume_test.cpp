// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/clip_for_test.hpp"
#include "job/fit_state.hpp"
#include "job/image_fit_state.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using ::testing::HasSubstr;

/// A fit of the filmed cube's stiffness, from one that is three times too large.
Json stiffness_from_film(const fs::path& folder) {
  film(filmed_cube(), folder, two_cameras());
  Json document = thrown_cube();
  document["task"] = "fit";
  document["scene"]["bodies"][0]["material"]["E"] = 9e4;
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}, {"noise", 0.3}}});
  document["fit"] = {{"parameters", {"material.E"}}};
  return document;
}

/// The same of its throw too, by colours.
Json throw_from_colours(const fs::path& folder) {
  film(filmed_cube(), folder, two_cameras(),
       [](const auto& scene, const auto& state, const auto& camera) {
         return paint(scene, state, camera, [](const Vec3d& rest) {
           return rest.x() > 0.2 ? Vec3d(0.8, 0.3, 0.2) : Vec3d(0.2, 0.6, 0.7);
         });
       });
  Json document = thrown_cube();
  document["task"] = "fit";
  document["scene"]["bodies"][0]["velocity"] = {0.6, 0.4, -1.3};
  document["captures"] = Json::array(
      {{{"cameras", "clip/transforms.json"}, {"noise", 0.3}, {"colours", {{"noise", 0.05}}}}});
  document["fit"] = {{"parameters", {"velocity"}}};
  return document;
}

/// Cancels a fit to images when its search has taken a step; its result.
Json cancel_in_search(const Json& document, const fs::path& folder,
                      ImagePhase phase = ImagePhase::kWide) {
  RunOptions options;
  options.threads = 2;
  Interrupter interrupter;
  Json result;
  std::thread fit([&] {
    try {
      result = run_job(job_of(document, folder), options, interrupter);
    } catch (const Error& error) {
      result = {{"status", error.what()}};
    }
  });
  for (int wait = 0; wait < 60'000; ++wait) {
    const auto state = read_image_fit_state(folder / "out");
    if (state && state->phase == phase && state->search && state->search->iteration > 0) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  interrupter.cancel();
  fit.join();
  EXPECT_EQ(result["status"], "cancelled");
  return result;
}

TEST(ImageResume, GoesOnToTheSameBits) {
  const Folder whole;
  const Folder broken;
  const Json document = stiffness_from_film(whole.path);
  (void)stiffness_from_film(broken.path);
  const Json expected = run(document, whole.path);
  const Json told = cancel_in_search(document, broken.path);
  auto state = read_image_fit_state(broken.path / "out");
  ASSERT_TRUE(state);
  EXPECT_EQ(told["exit_status"], 130);
  EXPECT_EQ(told["fit"]["parameters"][0]["value"], state->history.back().at("values")[0]);
  EXPECT_EQ(told["fit"]["converged"], false);
  EXPECT_THAT(told["fit"]["warning"].get<std::string>(), HasSubstr("best values so far"));
  const Json scene = Json::parse(std::ifstream(broken.path / "out/scene.json"));
  EXPECT_EQ(scene["scene"]["bodies"][0]["material"]["E"], told["fit"]["parameters"][0]["value"]);
  // A mark that only what is taken up can carry.
  state->evaluations += 1000;
  write_file(broken.path / "out" / kFitCheckpointPath, format_image_fit_state(*state));
  const Json result = run(document, broken.path);
  for (const char* key : {"parameters", "silhouettes", "iterations", "history"}) {
    EXPECT_EQ(result["fit"][key], expected["fit"][key]) << key;
  }
  EXPECT_EQ(result["fit"]["evaluations"].get<int>(),
            expected["fit"]["evaluations"].get<int>() + 1000);
  EXPECT_FALSE(fs::exists(broken.path / "out" / kFitCheckpointPath));
  // Its search is done: only what it found is told again.
  const Json again = run(document, broken.path);
  EXPECT_EQ(again["fit"]["evaluations"], result["fit"]["evaluations"]);
  Json other = document;
  other["scene"]["bodies"][0]["density"] = 1234.0;
  try {
    (void)run(other, broken.path);
    ADD_FAILURE() << "a fit of other inputs was replaced";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("density"));
  }
  other = document;
  other["captures"][0]["noise"] = 0.5;
  try {
    (void)run(other, broken.path);
    ADD_FAILURE() << "a fit to images of another noise was replaced";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("captures[0].noise"));
  }
  // Another matte of one image is another input.
  const Json cameras = Json::parse(std::ifstream(broken.path / "clip/transforms.json"));
  const std::string image = cameras["frames"][0]["file_path"].get<std::string>();
  const std::string later = cameras["frames"].back()["file_path"].get<std::string>();
  fs::copy_file(broken.path / "clip" / image, broken.path / "clip" / later,
                fs::copy_options::overwrite_existing);
  try {
    (void)run(document, broken.path);
    ADD_FAILURE() << "a fit to other images was taken for this one";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("captures[0].content"));
  }
}

TEST(ImageResume, GoesOnWhereTheThrowIsLookedFor) {
  const Folder whole;
  const Folder broken;
  const Json document = throw_from_colours(whole.path);
  (void)throw_from_colours(broken.path);
  const Json expected = run(document, whole.path);
  (void)cancel_in_search(document, broken.path, ImagePhase::kThrow);
  const Json result = run(document, broken.path);
  for (const char* key : {"parameters", "silhouettes", "iterations", "history", "evaluations"}) {
    EXPECT_EQ(result["fit"][key], expected["fit"][key]) << key;
  }
}

// What a panel takes for the time left is what has passed times (1 − share) / share.
TEST(ImageFitState, TheTimeThatSeemsLeftFalls) {
  for (const std::size_t numbers : {std::size_t{1}, std::size_t{8}}) {
    double left = 1e9;
    for (int simulations = 1; simulations < 40 * int(numbers + 1); ++simulations) {
      const double share = searched_share(simulations, numbers);
      EXPECT_GT(share, 0.0);
      EXPECT_LT(share, 1.0);
      const double now = simulations * (1.0 - share) / share;
      EXPECT_LT(now, left);
      left = now;
    }
  }
}

TEST(ImageResume, ADamagedCheckpointIsNone) {
  const Folder folder;
  ImageFitState state;
  state.phase = ImagePhase::kScan;
  state.values = {1.0};
  fs::create_directories(folder.path / "fit");
  std::string text = format_image_fit_state(state);
  write_file(folder.path / kFitCheckpointPath, text);
  ASSERT_TRUE(read_image_fit_state(folder.path));
  text[text.find("\"phase\":3") + 8] = '4';
  write_file(folder.path / kFitCheckpointPath, text);
  EXPECT_FALSE(read_image_fit_state(folder.path));
}

}  // namespace
}  // namespace matterfit::job
