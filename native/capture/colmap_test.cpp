// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/colmap.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <span>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "capture/bytes_for_test.hpp"
#include "capture/colmap_for_test.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Two cameras in poses of no symmetry, the second with a lens.
CameraSet two_cameras() {
  CameraSet set;
  for (int k = 0; k < 2; ++k) {
    splat::Camera camera;
    camera.width = 640;
    camera.height = 480;
    camera.fx = 700.0 + 13.0 * k;
    camera.fy = 690.5;
    camera.cx = 311.25;
    camera.cy = 250.75;
    camera.rotation =
        Eigen::AngleAxisd(0.9 + 2.0 * k, Vec3d(1, 2 - k, -0.5).normalized()).toRotationMatrix();
    camera.translation = Vec3d(0.3, -1.2, 4.5 + k);
    set.cameras.push_back(camera);
    set.lenses.push_back(k == 0 ? Distortion{} : Distortion{-0.11, 0.03, 0.0, 0.001, -0.002});
  }
  for (const auto& [name, k] : {std::pair("left/0003.png", 0), std::pair("right/0003.png", 1),
                                std::pair("left/0004.png", 0)}) {
    Shot shot;
    shot.image = name;
    shot.camera = std::size_t(k);
    set.shots.push_back(shot);
  }
  return set;
}

CameraSet parse_binary(const ColmapFiles& files) {
  return parse_colmap_binary(bytes_of(files.cameras), bytes_of(files.images), "model");
}
CameraSet parse_text(const ColmapFiles& files) {
  return parse_colmap_text(files.cameras, files.images, "model");
}

/// PAC-NeRF's list, written by its definition.
CameraSet through_all_data(const CameraSet& set) {
  nlohmann::json list = nlohmann::json::array();
  for (const Shot& shot : set.shots) {
    const splat::Camera& c = set.cameras[shot.camera];
    const Mat3d axes = c.rotation.transpose() * Vec3d(1, -1, -1).asDiagonal();
    nlohmann::json rows = nlohmann::json::array();
    for (int i = 0; i < 3; ++i) rows.push_back({axes(i, 0), axes(i, 1), axes(i, 2), c.centre()[i]});
    list.push_back({{"file_path", shot.image},
                    {"c2w", rows},
                    {"intrinsic", {{c.fx, 0, c.cx}, {0, c.fy, c.cy}, {0, 0, 1}}}});
  }
  return parse_cameras(list.dump(), "all_data.json", [](const std::string&) {
    return std::array<int, 2>{640, 480};
  });
}

struct Ray {
  Vec3d origin;
  Vec3d direction;
};
Ray ray_of(const splat::Camera& c, double u, double v) {
  return {c.centre(),
          (c.rotation.transpose() * Vec3d((u - c.cx) / c.fx, (v - c.cy) / c.fy, 1.0).normalized())};
}

const splat::Camera& camera_of(const CameraSet& set, const std::string& image) {
  for (const Shot& shot : set.shots) {
    if (shot.image == image) return set.cameras[shot.camera];
  }
  throw std::runtime_error(image + " is not there");
}

TEST(Colmap, AllFormatsGiveTheSameRays) {
  const CameraSet set = two_cameras();
  const CameraSet json = parse_cameras(format_cameras(set), "transforms.json", {});
  const CameraSet text = parse_text(colmap_text(set));
  const CameraSet binary = parse_binary(colmap_binary(set));
  const CameraSet pac = through_all_data(set);
  for (const Shot& shot : set.shots) {
    const splat::Camera& expected = set.cameras[shot.camera];
    for (const CameraSet* read : {&json, &text, &binary, &pac}) {
      EXPECT_EQ(read->cameras.size(), 2U);
      const splat::Camera& camera = camera_of(*read, shot.image);
      for (const auto& [u, v] :
           {std::pair(0.5, 0.5), std::pair(639.5, 12.0), std::pair(100., 479.)}) {
        const Ray a = ray_of(camera, u, v);
        const Ray b = ray_of(expected, u, v);
        EXPECT_LT((a.origin - b.origin).norm(), 1e-12);
        EXPECT_LT((a.direction - b.direction).norm(), 1e-12);
      }
    }
  }
  for (const CameraSet* read : {&json, &text, &binary}) {
    const Distortion& lens = read->lenses[1];
    EXPECT_EQ(lens.k1, -0.11);
    EXPECT_EQ(lens.k2, 0.03);
    EXPECT_EQ(lens.p1, 0.001);
    EXPECT_EQ(lens.p2, -0.002);
    EXPECT_TRUE(read->lenses[0].none());
  }
}

/// By hand: turned by 90° about x, the camera looks along the world's −y: z of the camera is
/// R·(0, −1, 0). Its own centre is −Rᵀ t.
TEST(Colmap, APoseTakesTheWorldToTheCamera) {
  const auto set = parse_colmap_text("1 SIMPLE_PINHOLE 640 480 500 320 240\n",
                                     "1 0.5 0.5 0 0 1 2 3 1 a_1.png\n\n", "model");
  const splat::Camera& camera = set.cameras.front();
  EXPECT_LT((camera.rotation * Vec3d(0, -1, 0) - Vec3d(0, 0, -1)).norm(), 1e-12);
  EXPECT_LT((camera.centre() - Vec3d(-1, -3, 2)).norm(), 1e-12);
  EXPECT_EQ(camera.fy, 500.0);
}

TEST(Colmap, EachModelsNumbersStandWhereTheyBelong) {
  const auto lens_of = [](const std::string& line) {
    const auto set = parse_colmap_text("3 " + line, "1 1 0 0 0 0 0 1 3 a 1.png", "model");
    EXPECT_EQ(set.shots.at(0).image, "a 1.png");
    EXPECT_EQ(set.cameras[0].cx, 320.0);
    EXPECT_EQ(set.cameras[0].cy, 240.0);
    return set.lenses.at(0);
  };
  EXPECT_EQ(lens_of("SIMPLE_RADIAL 640 480 500 320 240 -0.1").k1, -0.1);
  EXPECT_EQ(lens_of("RADIAL 640 480 500 320 240 -0.1 0.02").k2, 0.02);
  EXPECT_EQ(lens_of("OPENCV 640 480 500 510 320 240 -0.1 0.02 0.001 0.003").p2, 0.003);
  const Distortion full =
      lens_of("FULL_OPENCV 640 480 500 510 320 240 -0.1 0.02 0.001 0.003 -0.004 0 0 0");
  EXPECT_EQ(full.k3, -0.004);
  EXPECT_EQ(full.p1, 0.001);
}

std::string message_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}
std::string text_message(const std::string& cameras, const std::string& images) {
  return message_of([&] { (void)parse_colmap_text(cameras, images, "model"); });
}

TEST(Colmap, WhatIsBrokenIsNamed) {
  const std::string camera = "1 PINHOLE 640 480 500 500 320 240\n";
  const std::string image = "1 1 0 0 0 0 0 1 1 a_1.png\n\n";
  EXPECT_THAT(text_message("1 OPENCV_FISHEYE 640 480 500 500 320 240 0 0 0 0\n", image),
              HasSubstr("model/cameras.txt: line 1: camera 1 is of the model 'OPENCV_FISHEYE'"));
  EXPECT_THAT(text_message("1 FULL_OPENCV 640 480 500 510 320 240 0 0 0 0 0 0.1 0 0\n", image),
              HasSubstr("FULL_OPENCV with k4, k5 or k6"));
  EXPECT_THAT(text_message("1 PINHOLE 640 480 500 320 240\n", image),
              HasSubstr("has 3 parameters, PINHOLE has 4"));
  EXPECT_THAT(text_message("1 PINHOLE 0 480 500 500 320 240\n", image),
              HasSubstr("an image size of 0"));
  EXPECT_THAT(text_message("1 PINHOLE 640 480 -5 500 320 240\n", image),
              HasSubstr("a focal length of -5"));
  EXPECT_THAT(text_message("one PINHOLE\n", image), HasSubstr("the camera's number is 'one'"));
  EXPECT_THAT(text_message(camera + camera, image), HasSubstr("the number of an earlier camera"));
  EXPECT_THAT(text_message(camera, "# nothing\n"), HasSubstr("its cameras have no images"));
  EXPECT_THAT(text_message(camera, "1 0 0 0 0 0 0 1 1 a_1.png\n\n"),
              HasSubstr("line 1: image 'a_1.png' has a pose that is none"));
  EXPECT_THAT(text_message(camera, "1 1 0 0 0 0 0 1 2 a_1.png\n\n"),
              HasSubstr("is of camera 2, which the cameras' file does not have"));
  EXPECT_THAT(text_message(camera, "1 1 0 0 0 0 0 1 1\n\n"), HasSubstr("the image has no name"));
  EXPECT_THAT(text_message("1 SIMPLE_RADIAL 640 480 300 320 240 -0.9\n", image),
              HasSubstr("folds over inside the image"));

  const ColmapFiles whole = colmap_binary(two_cameras());
  ColmapFiles cut = whole;
  cut.images.resize(cut.images.size() - 1);
  EXPECT_THAT(message_of([&] { (void)parse_binary(cut); }), HasSubstr("model/images.bin"));
  cut = whole;
  cut.cameras.resize(30);
  EXPECT_THAT(message_of([&] { (void)parse_binary(cut); }),
              HasSubstr("model/cameras.bin: a camera's height at byte 24"));
  ColmapFiles fisheye = whole;
  fisheye.cameras[12] = 5;
  EXPECT_THAT(message_of([&] { (void)parse_binary(fisheye); }),
              HasSubstr("camera 7 is of the model OPENCV_FISHEYE"));
  fisheye.cameras[12] = 77;
  EXPECT_THAT(message_of([&] { (void)parse_binary(fisheye); }),
              HasSubstr("camera 7 is of the model number 77"));
}

class ColmapFolderTest : public ::testing::Test {
 protected:
  void write(const char* folder, const ColmapFiles& files, const char* ending) {
    write_file(scratch_.path / folder / (std::string("cameras") + ending), files.cameras);
    write_file(scratch_.path / folder / (std::string("images") + ending), files.images);
  }
  void touch(const char* file) { write_file(scratch_.path / file, "x"); }

  const Folder scratch_;
};

TEST_F(ColmapFolderTest, AProjectsModelIsFoundWithItsImagesAndMattes) {
  write("sparse/0", colmap_text(two_cameras()), ".txt");
  for (const char* file : {"images/left/0003.png", "images/left/0004.png", "images/right/0003.png",
                           "masks/left/0003.png.png", "masks/right/0003.png"}) {
    touch(file);
  }
  const CameraSet set = read_cameras(scratch_.path);
  EXPECT_EQ(set.folder, scratch_.path / "images");
  ASSERT_EQ(set.shots.size(), 3U);
  EXPECT_EQ(set.shots[0].image, "left/0003.png");
  EXPECT_EQ(set.shots[0].mask, "../masks/left/0003.png.png");
  EXPECT_EQ(set.shots[0].number, 3);
  EXPECT_EQ(set.shots[1].mask, "");
  EXPECT_EQ(set.shots[2].mask, "../masks/right/0003.png");
  EXPECT_THAT(set.notes, IsEmpty());
  // The binary one is taken where both are there, a file that is named is taken as it is.
  CameraSet other = two_cameras();
  other.cameras[0].fx = 800.0;
  write("sparse/0", colmap_binary(other), ".bin");
  EXPECT_EQ(read_cameras(scratch_.path).cameras[0].fx, 800.0);
  EXPECT_EQ(read_cameras(scratch_.path / "sparse/0/images.txt").cameras[0].fx, 700.0);
}

TEST_F(ColmapFolderTest, ImagesOfASequenceThatWereNotRegisteredAreOfItsCamera) {
  write("sparse", colmap_text(two_cameras()), ".txt");
  for (const char* file :
       {"images/left/0003.png", "images/left/0004.png", "images/left/0005.png",
        "images/left/plate.png", "images/right/0003.png", "images/right/0004.png"}) {
    touch(file);
  }
  const CameraSet set = read_cameras(scratch_.path);
  std::vector<std::string> names;
  for (const Shot& shot : set.shots) names.push_back(std::to_string(shot.camera) + shot.image);
  EXPECT_THAT(names, ElementsAre("0left/0003.png", "0left/0004.png", "1right/0003.png",
                                 "0left/0005.png", "1right/0004.png"));
  EXPECT_THAT(set.notes, ElementsAre(HasSubstr("2 images that the model does not name")));
}

TEST_F(ColmapFolderTest, ASequenceOfSeveralCamerasIsNotContinued) {
  CameraSet still = two_cameras();
  still.shots.resize(2);
  still.shots[0].image = "1.png";
  still.shots[1].image = "2.png";
  write("sparse", colmap_binary(still), ".bin");
  for (const char* file : {"images/1.png", "images/2.png", "images/3.png"}) touch(file);
  EXPECT_EQ(read_cameras(scratch_.path).shots.size(), 2U);
}

TEST_F(ColmapFolderTest, ACameraWithoutAnImageIsSaid) {
  CameraSet set = two_cameras();
  const std::string said = "cameras without an image are left out, by the model's numbers: 9.";
  set.cameras.push_back(set.cameras[1]);
  touch("images/left/0003.png");
  write("sparse", colmap_text(set), ".txt");
  EXPECT_THAT(read_cameras(scratch_.path).notes, ElementsAre(HasSubstr(said)));
  EXPECT_EQ(read_cameras(scratch_.path).cameras.size(), 2U);
  write("sparse", colmap_binary(set), ".bin");
  EXPECT_THAT(read_cameras(scratch_.path).notes, ElementsAre(HasSubstr(said)));
}

TEST_F(ColmapFolderTest, AFolderWithoutAModelIsSaid) {
  EXPECT_THAT(message_of([&] { (void)read_cameras(scratch_.path); }),
              HasSubstr("holds no COLMAP model"));
  EXPECT_THAT(message_of([&] { (void)read_cameras(scratch_.path / "images.bin"); }),
              HasSubstr("cameras.bin"));
  // Without images the cameras are read all the same: nothing but a matte needs them.
  write("sparse", colmap_text(two_cameras()), ".txt");
  EXPECT_TRUE(read_cameras(scratch_.path).folder.empty());
}

}  // namespace
}  // namespace matterfit::capture
