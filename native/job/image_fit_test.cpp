// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "capture/colmap_for_test.hpp"
#include "capture/image_file.hpp"
#include "capture/lens.hpp"
#include "capture/srgb.hpp"
#include "job/clip_for_test.hpp"
#include "job/run/inspect.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using ::testing::HasSubstr;

/// What a lens makes of a pinhole's image.
capture::Bitmap through_lens(const capture::Bitmap& ideal, const splat::Camera& camera,
                             const capture::Distortion& lens) {
  capture::Bitmap taken(ideal.width, ideal.height);
  taken.has_alpha = true;
  for (int y = 0; y < taken.height; ++y) {
    for (int x = 0; x < taken.width; ++x) {
      const auto place = capture::undistorted(
          lens,
          Eigen::Vector2d((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy));
      const int i = int(std::floor(camera.fx * place->x() + camera.cx));
      const int j = int(std::floor(camera.fy * place->y() + camera.cy));
      if (i < 0 || j < 0 || i >= ideal.width || j >= ideal.height) continue;
      const auto alpha = [](const capture::Bitmap& image, int row, int column) {
        return 4 * (std::size_t(row) * std::size_t(image.width) + std::size_t(column)) + 3;
      };
      taken.rgba[alpha(taken, y, x)] = ideal.rgba[alpha(ideal, j, i)];
    }
  }
  return taken;
}

Json fit_to_clip(const std::vector<std::string>& parameters) {
  Json document = thrown_cube();
  document["task"] = "fit";
  Json& body = document["scene"]["bodies"][0];
  body["material"]["E"] = 9e4;
  body["velocity"] = {0.6, 0.4, -1.3};
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}, {"noise", 0.3}}});
  document["fit"] = {{"parameters", parameters}};
  return document;
}

/// The clip is of another particle separation: what that makes of the values is in their intervals.
TEST(ImageFit, StiffnessAndThrowFromMattesAlone) {
  const Folder folder;
  film(filmed_cube(), folder.path, two_cameras());
  Json document = fit_to_clip({"velocity", "material.E"});
  document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
  const Json result = run(document, folder.path);
  const Json& fit = result.at("fit");
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E"), 3e4, 0.3 * 3e4) << fit.dump(1);
  EXPECT_NEAR(value_of(result, "bodies.cube.velocity[0]"), 0.8, 0.05);
  EXPECT_NEAR(value_of(result, "bodies.cube.velocity[1]"), 0.3, 0.05);
  EXPECT_NEAR(value_of(result, "bodies.cube.velocity[2]"), -1.5, 0.05);
  const std::map<std::string, double> truths = {{"bodies.cube.material.E", 3e4},
                                                {"bodies.cube.velocity[0]", 0.8},
                                                {"bodies.cube.velocity[1]", 0.3},
                                                {"bodies.cube.velocity[2]", -1.5}};
  for (const Json& parameter : fit.at("parameters")) {
    const double truth = truths.at(parameter.at("path").get<std::string>());
    EXPECT_GT(parameter.at("grid_error").get<double>(), 0.0) << parameter.dump(1);
    EXPECT_LE(parameter.at("interval")[0].get<double>(), truth) << parameter.dump(1);
    EXPECT_GE(parameter.at("interval")[1].get<double>(), truth) << parameter.dump(1);
  }
  const Json& after = fit.at("silhouettes").at("after");
  const Json& before = fit.at("silhouettes").at("before");
  EXPECT_EQ(after.at("held_out").at("images"), 6);
  EXPECT_GT(after.at("held_out").at("iou").get<double>(), 0.92);
  EXPECT_LT(after.at("held_out").at("contour_px").get<double>(), 1.0);
  EXPECT_GT(before.at("held_out").at("contour_px").get<double>(), 2.0);
  EXPECT_TRUE(fs::exists(folder.path / "out/material.json"));
}

/// From a start that is six times too stiff and thrown otherwise: what the throw displaces is not
/// taken for the material.
TEST(ImageFit, OneCameraTellsTheThrowBeforeTheStiffness) {
  const Folder folder;
  film(filmed_cube(), folder.path, {two_cameras().front()});
  Json document = fit_to_clip({"velocity", "material.E"});
  Json& body = document["scene"]["bodies"][0];
  body["material"]["E"] = 1.8e5;
  body["velocity"] = {-1.2, -0.9, 0.5};
  document["captures"][0]["holdout"] = {{"frames", {11, 14}}};
  const Json result = run(document, folder.path);
  const Json& fit = result.at("fit");
  EXPECT_NEAR(std::log(value_of(result, "bodies.cube.material.E") / 3e4), 0.0, std::log(2.0))
      << fit.dump(1);
  EXPECT_NEAR(value_of(result, "bodies.cube.velocity[0]"), 0.8, 0.2);
  EXPECT_NEAR(value_of(result, "bodies.cube.velocity[1]"), 0.3, 0.2);
  EXPECT_NEAR(value_of(result, "bodies.cube.velocity[2]"), -1.5, 0.2);
  EXPECT_EQ(fit.at("history").front().at("stage"), "throw");
}

/// A closed mesh that is nearly round, and no two of its outlines alike.
void write_potato(const fs::path& path) {
  constexpr int kRings = 12;
  constexpr int kAround = 18;
  std::ofstream file(path);
  const auto vertex = [&](double polar, double azimuth) {
    const double radius =
        0.2 * (1.0 + 0.15 * std::cos(polar) + 0.2 * std::sin(polar) * std::cos(2.0 * azimuth) +
               0.1 * std::sin(polar) * std::sin(azimuth));
    file << "v " << radius * std::sin(polar) * std::cos(azimuth) << ' '
         << radius * std::sin(polar) * std::sin(azimuth) << ' ' << radius * std::cos(polar) << '\n';
  };
  vertex(0.0, 0.0);
  for (int i = 1; i < kRings; ++i) {
    for (int j = 0; j < kAround; ++j) {
      vertex(std::numbers::pi * i / kRings, 2.0 * std::numbers::pi * j / kAround);
    }
  }
  vertex(std::numbers::pi, 0.0);
  const auto at = [](int ring, int j) { return 2 + (ring - 1) * kAround + j % kAround; };
  const int last = 2 + (kRings - 1) * kAround;
  for (int j = 0; j < kAround; ++j) {
    file << "f 1 " << at(1, j) << ' ' << at(1, j + 1) << '\n';
    for (int i = 1; i + 1 < kRings; ++i) {
      file << "f " << at(i, j) << ' ' << at(i + 1, j) << ' ' << at(i + 1, j + 1) << ' '
           << at(i, j + 1) << '\n';
    }
    file << "f " << at(kRings - 1, j + 1) << ' ' << at(kRings - 1, j) << ' ' << last << '\n';
  }
}

/// A body that is nearly round and falls soon: what a stiffness that is thirteen times too large
/// does to its contact is not taken for spin.
TEST(ImageFit, AContactIsNotTakenForSpin) {
  const Folder folder;
  write_potato(folder.path / "potato.obj");
  Json truth = filmed_cube();
  Json& potato = truth["scene"]["bodies"][0];
  potato["source"] = {{"mesh", "../potato.obj"}};
  potato["placement"] = {{"position", {0, 0, 0.36}}};
  potato["velocity"] = {0.5, 0.1, -1.5};
  potato["spin"] = {0, 5, 2};
  film(truth, folder.path, two_cameras());
  Json document = fit_to_clip({"velocity", "spin", "material.E"});
  Json& body = document["scene"]["bodies"][0];
  body["source"] = {{"mesh", "potato.obj"}};
  body["placement"] = potato.at("placement");
  body["velocity"] = {0, 0, 0};
  body["material"]["E"] = 4e5;
  const Json result = run(document, folder.path);
  const Json& fit = result.at("fit");
  EXPECT_NEAR(value_of(result, "bodies.cube.material.E"), 3e4, 0.4 * 3e4) << fit.dump(1);
  // The search of everything begins at the flight's throw, and not at what contact made of it.
  const Json& history = fit.at("history");
  const auto wide = std::find_if(history.begin(), history.end(),
                                 [](const Json& entry) { return entry.at("stage") == "wide"; });
  ASSERT_NE(wide, history.end());
  EXPECT_NEAR(wide->at("values")[2].get<double>(), -1.5, 0.1);
  EXPECT_NEAR(wide->at("values")[4].get<double>(), 5.0, 1.0);
  EXPECT_NEAR(wide->at("values")[5].get<double>(), 2.0, 1.0);
  EXPECT_NEAR(value_of(result, "bodies.cube.spin[0]"), 0.0, 1.0);
  EXPECT_NEAR(value_of(result, "bodies.cube.spin[1]"), 5.0, 1.0);
  EXPECT_NEAR(value_of(result, "bodies.cube.spin[2]"), 2.0, 1.0);
  EXPECT_GT(fit.at("silhouettes").at("after").at("fitted").at("iou").get<double>(), 0.92);
  EXPECT_EQ(fit.at("warning"), "");
}

/// A throw that is wrong and not fitted.
TEST(ImageFit, OutlinesThatDoNotMeetAreAWarning) {
  const Folder folder;
  film(filmed_cube(), folder.path, two_cameras());
  Json document = fit_to_clip({"material.E"});
  document["scene"]["bodies"][0]["velocity"] = {-0.4, 0.3, -1.0};
  const Json fit = run(document, folder.path).at("fit");
  EXPECT_THAT(fit.at("warning").get<std::string>(), ::testing::HasSubstr("overlap by"));
}

/// The images as a lens takes them, by the inverse of its distortion, which the reader does not use
/// for this.
TEST(ImageFit, WhatALensDistortsIsUndistorted) {
  const Folder folder;
  const std::vector<splat::Camera> cameras = two_cameras();
  film(filmed_cube(), folder.path, cameras);
  const capture::Distortion lens{0.9, 0.0, 0.0, 0.002, -0.001};
  capture::CameraSet set = capture::read_cameras(folder.path / "clip/transforms.json");
  const auto fit_of = [&](const std::string& name) {
    Json document = fit_to_clip({"velocity"});
    document["scene"]["bodies"][0]["material"]["E"] = 3e4;
    document["captures"][0]["cameras"] = name + ".json";
    document["fit"]["iterations"] = 8;
    document["output"]["folder"] = name + "_out";
    return run(document, folder.path).at("fit");
  };
  for (const capture::Shot& shot : set.shots) {
    const capture::Bitmap ideal = capture::read_image(folder.path / "clip" / shot.image);
    capture::write_png(folder.path / "lens" / shot.image,
                       through_lens(ideal, set.cameras[shot.camera], lens));
  }
  write_file(folder.path / "lens/ignored.json", capture::format_cameras(set));
  set.lenses.assign(set.cameras.size(), lens);
  write_file(folder.path / "lens/transforms.json", capture::format_cameras(set));
  const Json plain = fit_of("clip/transforms");
  const Json seen = fit_of("lens/transforms");
  const Json ignored = fit_of("lens/ignored");
  const Json& fitted = seen.at("silhouettes").at("after").at("fitted");
  EXPECT_GT(fitted.at("iou").get<double>(), 0.92);
  const auto misses = [&](const Json& fit) {
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double off = fit.at("parameters")[k].at("value").get<double>() -
                         plain.at("parameters")[k].at("value").get<double>();
      sum += off * off;
    }
    return std::sqrt(sum);  // [m/s]
  };
  EXPECT_LT(misses(seen), 0.01);
  EXPECT_GT(misses(ignored), 3.0 * misses(seen)) << "the lens matters";
  EXPECT_THAT(seen.at("statements").dump(), HasSubstr("% of its image are not seen by it"));
}

/// A COLMAP model that names one image of each camera; colours before a background, and the
/// background alone.
TEST(ImageFit, AColmapModelWithCleanPlates) {
  const Folder folder;
  film(filmed_cube(), folder.path, two_cameras());
  capture::CameraSet set = capture::read_cameras(folder.path / "clip/transforms.json");
  const fs::path project = folder.path / "project";
  capture::CameraSet named = set;
  named.shots.clear();
  for (const capture::Shot& shot : set.shots) {
    capture::Bitmap image = capture::read_image(folder.path / "clip" / shot.image);
    capture::Bitmap plate(image.width, image.height);
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      const double alpha = image.rgba[4 * i + 3] / 255.0;
      for (std::size_t c = 0; c < 3; ++c) {
        const double behind = 0.1 + 0.1 * double((i / 7 + i / 600) % 3) + 0.05 * double(c);
        plate.rgba[4 * i + c] = capture::byte_of_linear(behind);
        image.rgba[4 * i + c] =
            capture::byte_of_linear((1.0 - alpha) * behind + alpha * (c == 0 ? 0.6 : 0.05));
      }
      image.rgba[4 * i + 3] = plate.rgba[4 * i + 3] = 255;
    }
    image.has_alpha = false;
    const std::string camera = "c" + std::to_string(shot.camera);
    const std::string name = camera + "/" + std::to_string(*shot.number) + ".png";
    capture::write_png(project / "images" / name, image);
    capture::write_png(folder.path / "plates" / (camera + ".png"), plate);
    if (*shot.number != 0) continue;
    named.shots.push_back(shot);
    named.shots.back().image = name;
  }
  const capture::ColmapFiles model = capture::colmap_binary(named);
  write_file(project / "sparse/0/cameras.bin", model.cameras);
  write_file(project / "sparse/0/images.bin", model.images);

  Json document = fit_to_clip({"velocity"});
  document["scene"]["bodies"][0]["material"]["E"] = 3e4;
  document["captures"][0]["cameras"] = "project";
  document["captures"][0]["plate"] = {{"images", "plates/c#.png"}};
  document["fit"]["iterations"] = 8;
  const Json fit = run(document, folder.path).at("fit");
  EXPECT_EQ(fit.at("silhouettes").at("after").at("fitted").at("images"), 2 * 14);
  EXPECT_GT(fit.at("silhouettes").at("after").at("fitted").at("iou").get<double>(), 0.92);
  EXPECT_NEAR(fit.at("parameters")[0].at("value").get<double>(), 0.8, 0.05);
  EXPECT_NEAR(fit.at("parameters")[1].at("value").get<double>(), 0.3, 0.05);
  EXPECT_NEAR(fit.at("parameters")[2].at("value").get<double>(), -1.5, 0.05);

  Json summary = {{"cameras", ""},
                  {"plate", {{"images", (folder.path / "plates/c#.png").string()}}}};
  const Json found = capture_summary(project, summary);
  EXPECT_EQ(found.at("cameras"), 2);
  EXPECT_EQ(found.at("places")[1].at("image"), "c1/0.png");
  EXPECT_THAT(found.at("text").dump(), HasSubstr("Mattes by what differs from clean plates"));
  EXPECT_THAT(found.at("text").dump(), HasSubstr("images that the model does not name"));

  Json picture = thrown_cube();
  picture["task"] = "render";
  picture["render"] = {{"cameras", "project/sparse/0"}, {"camera", 1}};
  picture["scene"]["frames"] = {0, 2};
  picture["output"]["folder"] = "pictures";
  const Json render = run(picture, folder.path).at("render");
  EXPECT_EQ(render.at("pictures"), 2);
  EXPECT_TRUE(render.at("notes").empty());
}

TEST(ImageFit, OneCameraThatIsHeldOutIsPredicted) {
  const Folder folder;
  film(filmed_cube(), folder.path, two_cameras());
  Json document = fit_to_clip({"velocity"});
  document["scene"]["bodies"][0]["material"]["E"] = 3e4;
  document["captures"][0]["holdout"] = {{"cameras", {1}}};
  document["fit"]["iterations"] = 8;
  const Json fit = run(document, folder.path).at("fit");
  const Json& after = fit.at("silhouettes").at("after");
  EXPECT_EQ(after.at("held_out").at("images"), 14);
  EXPECT_GT(after.at("held_out").at("iou").get<double>(), 0.9);
}

TEST(ImageFit, AHeldOutCameraThatLooksElsewhereIsAWarning) {
  const Folder folder;
  film(filmed_cube(), folder.path, two_cameras());
  const fs::path path = folder.path / "clip/transforms.json";
  capture::CameraSet set = capture::read_cameras(path);
  set.cameras[1].translation.x() += 20.0;
  write_file(path, capture::format_cameras(set));
  Json document = fit_to_clip({"material.E"});
  document["captures"][0]["holdout"] = {{"cameras", {1}}};
  document["fit"]["iterations"] = 2;
  const Json fit = run(document, folder.path).at("fit");
  EXPECT_THAT(fit.at("warning").get<std::string>(), HasSubstr("do not predict them"));
}

TEST(ImageFit, ACameraThatShowsNothingIsLeftOut) {
  const Folder folder;
  std::vector<splat::Camera> cameras = two_cameras();
  cameras.push_back(cameras[0]);
  cameras[2].translation.x() += 20.0;  // its mattes are empty
  film(filmed_cube(), folder.path, cameras);
  Json document = fit_to_clip({"material.E"});
  document["fit"]["iterations"] = 2;
  const Json fit = run(document, folder.path).at("fit");
  EXPECT_THAT(fit.at("warning").get<std::string>(), HasSubstr("camera 2 is left out"));
  EXPECT_TRUE(fit.at("cameras")[2].at("fitted").is_null());
  document["output"]["folder"] = "other";
  document["captures"][0]["holdout"] = {{"cameras", {0, 1}}};
  try {
    (void)run(document, folder.path);
    ADD_FAILURE() << "empty mattes were fitted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("captures[0]: no matte shows the body"));
  }
}

TEST(ImageFit, TimesThatAreNoSecondsAreAWarning) {
  const Folder folder;
  film(filmed_cube(), folder.path, two_cameras());
  const fs::path path = folder.path / "clip/transforms.json";
  capture::CameraSet set = capture::read_cameras(path);
  for (capture::Shot& shot : set.shots) shot.time = 1000.0 / 24.0 * double(*shot.number);
  write_file(path, capture::format_cameras(set));
  Json document = fit_to_clip({"material.E"});
  document["fit"]["iterations"] = 1;
  const Json fit = run(document, folder.path).at("fit");
  EXPECT_THAT(fit.at("warning").get<std::string>(), HasSubstr("Are they in seconds?"));
  EXPECT_THAT(capture_summary(path, Json::object()).at("text").dump(),
              HasSubstr("are their times in seconds?"));
}

TEST(ImageFit, WhatCannotBeFittedIsNamed) {
  const Folder folder;
  std::vector<splat::Camera> cameras = two_cameras();
  Json short_film = filmed_cube();
  short_film["scene"]["frames"] = {0, 3};
  film(short_film, folder.path, cameras);
  const auto message_of = [&](const Json& document) -> std::string {
    try {
      (void)run(document, folder.path);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return "";
  };
  Json document = fit_to_clip({"velocity"});
  document["captures"][0]["transform"] = {{"position", {0, 8, 0}}};
  EXPECT_THAT(message_of(document), HasSubstr("looks away"));
  document = fit_to_clip({"velocity"});
  document["captures"][0]["unit"] = 0.5;
  EXPECT_THAT(message_of(document), HasSubstr("of what the simulated body does"));
  document = fit_to_clip({"velocity"});
  document["captures"][0]["holdout"] = {{"cameras", {2}}};
  EXPECT_THAT(message_of(document), HasSubstr("captures[0]: there is no camera 2 to hold out"));
  document["captures"][0]["holdout"] = {{"cameras", {0, 1}}};
  EXPECT_THAT(message_of(document), HasSubstr("every image is held out"));
  document = fit_to_clip({"velocity"});
  document = fit_to_clip({"captures.clip.poses[2].turn"});
  EXPECT_THAT(message_of(document),
              HasSubstr("fit.parameters[0]: 'captures.clip.poses[2].turn': there is no camera 2"));
  document = fit_to_clip({"velocity", "captures.clip.poses[1].shift[0]"});
  document["captures"][0]["holdout"] = {{"cameras", {1}}};
  EXPECT_THAT(message_of(document),
              HasSubstr("'captures.clip.poses[1].shift[0]': no image of this camera is fitted"));
  document = fit_to_clip({"captures.clip.velocity"});
  EXPECT_THAT(message_of(document), HasSubstr("a capture by images has no scene of its own"));
  document = fit_to_clip({"velocity"});
  document["captures"][0]["poses"] = {Json::object(), Json::object(), Json::object()};
  EXPECT_THAT(message_of(document), HasSubstr("captures[0]: 'poses' has 3 cameras"));
  document = fit_to_clip({"captures.a.poses[0].turn"});
  document["captures"].push_back({{"tracks", "a.npz"}});
  EXPECT_THAT(message_of(document), HasSubstr("a capture by tracks, which has no cameras"));
  document = fit_to_clip({"velocity"});
  document["captures"].push_back({{"tracks", "clip.npz"}});
  EXPECT_THAT(message_of(document), HasSubstr("another capture is called 'clip'"));
}

}  // namespace
}  // namespace matterfit::job
