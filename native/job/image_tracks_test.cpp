// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/file.hpp"
#include "job/clip_for_test.hpp"

/// Fits to images and tracks together.
namespace matterfit::job {
namespace {

using namespace fit_test;

constexpr double kTrackNoise = 0.02;  // of the tracks [m]

const Json kImages = {{"cameras", "clip/transforms.json"},
                      {"noise", 0.3},
                      {"holdout", {{"frames", {12, 14}}, {"cameras", {1}}}}};
const Json kTrackCapture = {
    {"tracks", "a.npz"}, {"noise", kTrackNoise}, {"holdout", {{"frames", {12, 14}}}}};

Json fit_to(const std::vector<Json>& captures, const std::string& out) {
  Json document = thrown_cube();
  document["task"] = "fit";
  document["scene"]["bodies"][0]["velocity"] = {0.6, 0.4, -1.3};
  document["captures"] = captures;
  document["fit"] = {{"parameters", {"velocity"}}, {"iterations", 10}};
  document["output"] = {{"folder", out}};
  return document;
}

TEST(ImageTracks, EachCountsByItsNoise) {
  const Folder folder;
  Json truth = thrown_cube();
  truth["scene"]["particle_separation"] = 0.04;
  film(truth, folder.path, two_cameras());
  record(thrown_cube(), folder.path, "a", 5, kTrackNoise / kSize);
  const Json images = run(fit_to({kImages}, "images"), folder.path);
  const Json tracks = run(fit_to({kTrackCapture}, "tracks"), folder.path);
  const Json both = run(fit_to({kImages, kTrackCapture}, "both"), folder.path);
  const std::vector<double> thrown = {0.8, 0.3, -1.5};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto of = [&](const Json& result, const char* key) {
      return result.at("fit").at("parameters")[k].at(key).get<double>();
    };
    const auto weight = [&](const Json& result) {
      return 1.0 / std::pow(of(result, "standard_error"), 2);
    };
    EXPECT_NEAR(of(both, "value"), thrown[k], 0.05);
    // Errors are widened by what each kind is missed by, together by the mean of both: those of the
    // tracks by what the images are missed by, too.
    EXPECT_GT(weight(both), 0.3 * (weight(images) + weight(tracks)));
    const double low = std::min(of(images, "value"), of(tracks, "value"));
    const double high = std::max(of(images, "value"), of(tracks, "value"));
    const double slack = of(both, "standard_error");
    EXPECT_GT(of(both, "value"), low - slack);
    EXPECT_LT(of(both, "value"), high + slack);
  }
  const Json& fit = both.at("fit");
  EXPECT_EQ(fit.at("loss"), "silhouette and tracks");
  for (const char* kind : {"images", "tracks"}) {
    EXPECT_GT(fit.at("noise_scales").at(kind).get<double>(), 0.2) << kind;
    EXPECT_LT(fit.at("noise_scales").at(kind).get<double>(), 3.0) << kind;
  }
  EXPECT_NEAR(fit.at("after").at("held_out").at("rms_mm").get<double>(),
              1e3 * std::sqrt(3.0) * kTrackNoise, 20.0);
  const Json& held = fit.at("silhouettes").at("after").at("held_out");
  EXPECT_EQ(held.at("images"), 14 + 2);
  EXPECT_GT(held.at("iou").get<double>(), 0.9);
  EXPECT_TRUE(fit.at("cameras")[1].at("fitted").is_null());
  EXPECT_EQ(fit.at("cameras")[1].at("held_out").at("images"), 14);
  EXPECT_EQ(fit.at("cameras")[0].at("held_out").at("images"), 2);
  EXPECT_EQ(both.at("captures").size(), 1u);
}

/// What is fitted of a capture is written where it stands in the document.
TEST(ImageTracks, ValuesOfCapturesStandInTheirEntries) {
  const Folder folder;
  film(thrown_cube(), folder.path, two_cameras());
  record(thrown_cube(), folder.path, "a", 5);
  Json document = fit_to({kImages, kTrackCapture}, "out");
  document["captures"][1]["holdout"] = {{"capture", true}};
  document["fit"] = {
      {"parameters", {"velocity", "captures.clip.start_frame", "captures.clip.poses[0].turn[1]"}},
      {"iterations", 2}};
  const Json result = run(document, folder.path);
  EXPECT_EQ(result.at("fit").at("loss"), "silhouette");
  EXPECT_TRUE(result.at("fit").at("after").at("fitted").is_null());
  EXPECT_TRUE(result.at("fit").at("after").at("held_out").is_object());
  const auto bytes = read_file(folder.path / "out/scene.json");
  const Json scene =
      Json::parse(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  EXPECT_EQ(scene["captures"][0]["start_frame"], value_of(result, "captures.clip.start_frame"));
  EXPECT_EQ(scene["captures"][0]["poses"][0]["turn"][1],
            value_of(result, "captures.clip.poses[0].turn[1]"));
  EXPECT_FALSE(scene["captures"][1].contains("start_frame"));
}

/// Clouds without correspondence beside masks: neither alone says what both do of these.
TEST(ImageTracks, CloudsBesideMasks) {
  const Folder folder;
  film(filmed_cube(), folder.path, two_cameras());
  for (const char* loss : {"chamfer", "surface"}) {
    SCOPED_TRACE(loss);
    const Folder tracks;
    const Points points = std::string(loss) == "surface" ? shell(300) : cloud(300);
    record(thrown_cube(), tracks.path, "a", 5, 2e-3, points);
    Json document = fit_to({kImages, {{"tracks", (tracks.path / "a.npz").string()}}}, loss);
    document["fit"]["loss"] = loss;
    document["fit"]["iterations"] = 6;
    const Json result = run(document, folder.path);
    const Json& fit = result.at("fit");
    EXPECT_EQ(fit.at("loss"), "silhouette and " + std::string(loss));
    EXPECT_NEAR(value_of(result, "bodies.cube.velocity[0]"), 0.8, 0.05) << fit.dump(1);
    EXPECT_NEAR(value_of(result, "bodies.cube.velocity[1]"), 0.3, 0.05);
    EXPECT_NEAR(value_of(result, "bodies.cube.velocity[2]"), -1.5, 0.05);
    EXPECT_TRUE(fit.at("noise_scales").at("tracks").is_number());
  }
}

/// The whole fit, its errors too.
TEST(ImageTracks, SameBitsForAnyThreads) {
  const Folder folder;
  Json truth = filmed_cube();
  truth["scene"]["frames"] = {0, 6};
  film(truth, folder.path, two_cameras());
  std::string first;
  for (const int threads : {1, 2, 8}) {
    Json document = fit_to({kImages}, "out_" + std::to_string(threads));
    document["scene"]["frames"] = {0, 6};
    document["captures"][0].erase("holdout");
    document["fit"] = {{"parameters", {"velocity", "material.E"}}, {"iterations", 3}};
    const std::string found = bits(run(document, folder.path, threads));
    if (first.empty()) first = found;
    EXPECT_EQ(found, first) << threads;
  }
}

}  // namespace
}  // namespace matterfit::job
