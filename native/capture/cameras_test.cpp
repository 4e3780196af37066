// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/cameras.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <string>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const ImageSize kSize = [](const std::string&) { return std::array<int, 2>{640, 480}; };

/// Stands at (1, −5, 2), looks along +y of the world, up is z: the pose of both files below.
constexpr const char* kPose = "[1,0,0,1],[0,0,-1,-5],[0,1,0,2]";

std::string transforms(const std::string& lens, const std::string& frames) {
  return "{" + lens + ", \"frames\": [" + frames + "]}";
}
std::string frame(const std::string& keys) {
  return std::string("{\"transform_matrix\": [") + kPose + ",[0,0,0,1]], " + keys + "}";
}

/// The direction in the world that a pixel sees.
Vec3d ray(const splat::Camera& c, double u, double v) {
  const Vec3d t((u - c.cx) / c.fx, (v - c.cy) / c.fy, 1.0);
  return (c.rotation.transpose() * t).normalized();
}

std::string refusal_of_cameras(const std::string& text) {
  try {
    (void)parse_cameras(text, "cams.json", kSize);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

TEST(Cameras, BothFormatsGiveTheSameRays) {
  const auto nerf = parse_cameras(
      transforms("\"fl_x\": 700, \"fl_y\": 690, \"cx\": 311, \"cy\": 250, \"w\": 640, \"h\": 480",
                 frame("\"file_path\": \"images/cam_0012\"")),
      "transforms.json", kSize);
  const auto pac = parse_cameras(
      std::string("[{\"file_path\": \"./data/r_0_12.png\", \"time\": 0.5, \"c2w\": [") + kPose +
          "], \"intrinsic\": [[700,0,311],[0,690,250],[0,0,1]]}]",
      "all_data.json", kSize);
  ASSERT_EQ(nerf.cameras.size(), 1U);
  ASSERT_EQ(pac.cameras.size(), 1U);
  for (const auto& [u, v] : {std::pair(0.5, 0.5), std::pair(639.5, 0.5), std::pair(100.0, 400.0)}) {
    EXPECT_LT((ray(nerf.cameras[0], u, v) - ray(pac.cameras[0], u, v)).norm(), 1e-12);
  }
  // By hand: the pixel at the principal point looks along the axis, one to the right of it to +x,
  // one below it to −z.
  const splat::Camera& camera = nerf.cameras[0];
  EXPECT_LT((camera.centre() - Vec3d(1, -5, 2)).norm(), 1e-12);
  EXPECT_LT((ray(camera, 311, 250) - Vec3d(0, 1, 0)).norm(), 1e-12);
  EXPECT_LT((ray(camera, 1011, 250) - Vec3d(1, 1, 0).normalized()).norm(), 1e-12);
  EXPECT_LT((ray(camera, 311, 940) - Vec3d(0, 1, -1).normalized()).norm(), 1e-12);
  EXPECT_EQ(nerf.shots[0].image, "images/cam_0012.png");
  EXPECT_EQ(nerf.shots[0].number, 12);
  EXPECT_FALSE(nerf.shots[0].time.has_value());
  EXPECT_EQ(pac.shots[0].time, 0.5);
}

TEST(Cameras, AnAngleOfViewIsAFocalLength) {
  const auto set = parse_cameras(
      transforms("\"camera_angle_x\": 1.5707963267948966", frame("\"file_path\": \"a\"")), "t",
      kSize);
  EXPECT_NEAR(set.cameras[0].fx, 320.0, 1e-9);
  EXPECT_NEAR(set.cameras[0].fy, 320.0, 1e-9);
  EXPECT_EQ(set.cameras[0].cx, 320.0);
  EXPECT_EQ(set.cameras[0].cy, 240.0);
}

TEST(Cameras, ImagesOfOnePoseAreOfOneCamera) {
  const std::string other =
      "{\"file_path\": \"b_0\", \"transform_matrix\": "
      "[[0,0,1,3],[1,0,0,0],[0,1,0,0],[0,0,0,1]]}";
  const auto set = parse_cameras(
      transforms("\"fl_x\": 500", frame("\"file_path\": \"a_0\", \"mask_path\": \"m/a_0.png\"") +
                                      "," + other + "," + frame("\"file_path\": \"a_1\"")),
      "t", kSize);
  EXPECT_EQ(set.cameras.size(), 2U);
  EXPECT_EQ(set.shots[0].camera, 0U);
  EXPECT_EQ(set.shots[1].camera, 1U);
  EXPECT_EQ(set.shots[2].camera, 0U);
  EXPECT_EQ(set.shots[0].mask, "m/a_0.png");
  const auto again = parse_cameras(format_cameras(set), "again", kSize);
  ASSERT_EQ(again.cameras.size(), 2U);
  EXPECT_EQ(again.shots[0].mask, set.shots[0].mask);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_LT((ray(again.cameras[k], 3, 7) - ray(set.cameras[k], 3, 7)).norm(), 1e-12);
    EXPECT_LT((again.cameras[k].centre() - set.cameras[k].centre()).norm(), 1e-12);
  }
}

TEST(Cameras, ALensIsReadAndWrittenAgain) {
  const auto set = parse_cameras(
      transforms(
          "\"fl_x\": 500, \"camera_model\": \"OPENCV\", \"k1\": 0.1, \"k2\": -0.02, "
          "\"p1\": 0.003, \"p2\": -0.004, \"k3\": 0.005",
          frame("\"file_path\": \"a_0\"") + "," + frame("\"file_path\": \"a_1\", \"k1\": 0.11")),
      "t", kSize);
  ASSERT_EQ(set.lenses.size(), 2U) << "cameras of two lenses are two";
  for (const auto& read : {set, parse_cameras(format_cameras(set), "again", kSize)}) {
    EXPECT_EQ(read.lenses[0].k1, 0.1);
    EXPECT_EQ(read.lenses[0].k2, -0.02);
    EXPECT_EQ(read.lenses[0].k3, 0.005);
    EXPECT_EQ(read.lenses[0].p1, 0.003);
    EXPECT_EQ(read.lenses[0].p2, -0.004);
    EXPECT_EQ(read.lenses[1].k1, 0.11);
  }
}

TEST(Cameras, AMovedCameraSeesTheMovedWorldAlike) {
  const auto set =
      parse_cameras(transforms("\"fl_x\": 500", frame("\"file_path\": \"a\"")), "t", kSize);
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() =
      0.01 * Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
  matrix.topRightCorner<3, 1>() = Vec3d(4, -1, 2);
  const splat::Camera camera = moved(set.cameras[0], matrix);
  const auto seen = [](const splat::Camera& c, const Vec3d& x) {
    const Vec3d t = c.rotation * x + c.translation;
    return Eigen::Vector2d(c.fx * t.x() / t.z() + c.cx, c.fy * t.y() / t.z() + c.cy);
  };
  const Vec3d x(1.5, 2.0, 0.5);
  const Vec3d y = (matrix * x.homogeneous()).head<3>();
  EXPECT_LT((seen(camera, y) - seen(set.cameras[0], x)).norm(), 1e-9);
  matrix(0, 0) += 0.01;
  EXPECT_THROW((void)moved(set.cameras[0], matrix), Error);
}

TEST(Cameras, HalfOfAPairIsSaid) {
  const std::string shot = frame("\"file_path\": \"a\"");
  const auto notes = [&](const std::string& lens) {
    return parse_cameras(transforms(lens, shot), "cams.json",
                         [](const std::string&) {
                           return std::array<int, 2>{64, 48};
                         })
        .notes;
  };
  EXPECT_THAT(notes("\"fl_x\": 50, \"cxx\": 30, \"cy\": 24"),
              ElementsAre(HasSubstr("gives 'cy' and no 'cx'")));
  EXPECT_THAT(notes("\"fl_x\": 50, \"cx\": 30, \"cy\": 24"), IsEmpty());
  EXPECT_THAT(notes("\"fl_x\": 50, \"w\": 64"), ElementsAre(HasSubstr("gives 'w' and no 'h'")));
  EXPECT_THROW((void)notes("\"fl_x\": 50, \"w\": 128"), Error);
}

TEST(Cameras, WhatIsBrokenIsNamed) {
  EXPECT_THAT(refusal_of_cameras("{\n \"frames\": ["),
              HasSubstr("cams.json: is no JSON text: it ends at line 2, column 12"));
  EXPECT_THAT(refusal_of_cameras("{\n \"w\": 3,}"),
              HasSubstr("cams.json: is no JSON text: it cannot be read on from line 2, column 9"));
  EXPECT_THAT(refusal_of_cameras("{\n \"fl_x\": NaN}"),
              HasSubstr("read on from line 2, column 10. Is a comma missing"));
  EXPECT_THAT(refusal_of_cameras("[1e999]"), HasSubstr("beyond what a double holds"));
  EXPECT_THAT(refusal_of_cameras("{\"frames\": 3}"), HasSubstr("neither a transforms.json"));
  EXPECT_THAT(refusal_of_cameras("[]"), HasSubstr("its cameras have no images"));
  const std::string lens = "\"fl_x\": 500";
  EXPECT_THAT(refusal_of_cameras(transforms(lens, "{\"file_path\": \"a\"}")),
              HasSubstr("image 0 has no 'transform_matrix'"));
  EXPECT_THAT(refusal_of_cameras(transforms(lens, frame("\"time\": 0"))),
              HasSubstr("has no 'file_path'"));
  EXPECT_THAT(refusal_of_cameras(transforms("\"fl_y\": 5", frame("\"file_path\": \"a\""))),
              HasSubstr("has no focal length"));
  EXPECT_THAT(refusal_of_cameras(transforms("\"fl_x\": -5", frame("\"file_path\": \"a\""))),
              HasSubstr("a focal length of -5"));
  EXPECT_THAT(
      refusal_of_cameras(transforms(lens + ", \"k1\": -0.9", frame("\"file_path\": \"a\""))),
      HasSubstr("image 0 has a lens distortion (k1 = -0.9, k2 = 0"));
  EXPECT_THAT(refusal_of_cameras(transforms(lens + ", \"k4\": 0.1", frame("\"file_path\": \"a\""))),
              HasSubstr("lens distortion by k4"));
  EXPECT_THAT(refusal_of_cameras(transforms(lens + ", \"camera_model\": \"OPENCV_FISHEYE\"",
                                            frame("\"file_path\": \"a\""))),
              HasSubstr("has the 'camera_model' OPENCV_FISHEYE, which is not read"));
  EXPECT_THAT(refusal_of_cameras(transforms(lens,
                                            "{\"file_path\": \"a\", \"transform_matrix\": "
                                            "[[2,0,0,0],[0,2,0,0],[0,0,2,0]]}")),
              HasSubstr("no rotation and shift"));
  EXPECT_THAT(
      refusal_of_cameras(transforms(lens + ", \"w\": 64, \"h\": 48",
                                    frame("\"file_path\": \"a\"") + "," +
                                        frame("\"file_path\": \"b\", \"w\": 65, \"cx\": 32"))),
      HasSubstr("image 1 is 65 × 48 pixels, but an earlier image of the same camera is"));
}

}  // namespace
}  // namespace matterfit::capture
