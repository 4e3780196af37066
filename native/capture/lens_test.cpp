// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/lens.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using ::testing::HasSubstr;

splat::Camera camera_of(int width, int height, double focal) {
  splat::Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = focal;
  camera.fy = 0.97 * focal;
  camera.cx = 0.51 * width;
  camera.cy = 0.48 * height;
  return camera;
}

/// Barrel, pincushion, a moustache, and strongly decentred ones.
std::vector<Distortion> lenses() {
  return {{-0.28, 0.07, 0.0, 0.0, 0.0},
          {0.2, 0.05, 0.0, 0.0, 0.0},
          {-0.3, 0.25, -0.04, 0.001, -0.002},
          {0.05, -0.02, 0.0, 0.02, -0.03},
          {0.0, 0.0, 0.0, 0.0, 0.0}};
}

TEST(Lens, TheInverseOfADistortionGivesThePlaceBack) {
  for (const Distortion& lens : lenses()) {
    for (double x = -0.6; x <= 0.6; x += 0.05) {
      for (double y = -0.5; y <= 0.5; y += 0.05) {
        const Vector2d ideal(x, y);
        const auto back = undistorted(lens, distorted(lens, ideal));
        ASSERT_TRUE(back.has_value()) << x << " " << y << " k1 " << lens.k1;
        EXPECT_LT((*back - ideal).norm(), 1e-13);
        const auto forth = undistorted(lens, ideal);
        ASSERT_TRUE(forth.has_value());
        EXPECT_LT((distorted(lens, *forth) - ideal).norm(), 1e-13);
      }
    }
  }
}

TEST(Lens, TheSlopeIsThatOfDifferences) {
  const double h = 1e-6;
  for (const Distortion& lens : lenses()) {
    const Vector2d at(0.31, -0.22);
    Matrix2d differences;
    for (int j = 0; j < 2; ++j) {
      differences.col(j) = (distorted(lens, at + h * Vector2d::Unit(j)) -
                            distorted(lens, at - h * Vector2d::Unit(j))) /
                           (2.0 * h);
    }
    EXPECT_LT((differences - distortion_slope(lens, at)).norm(), 1e-9);
  }
}

/// By hand, of OpenCV's formula: r² = .25, c = 1 + .1·.25 − .2·.0625 + .4·.015625 = 1.01875.
TEST(Lens, TheCoefficientsAreOpenCVs) {
  const Distortion lens{0.1, -0.2, 0.4, 0.01, -0.02};
  const Vector2d seen = distorted(lens, Vector2d(0.3, 0.4));
  EXPECT_NEAR(seen.x(), 1.01875 * 0.3 + 2 * 0.01 * 0.12 - 0.02 * (0.25 + 0.18), 1e-15);
  EXPECT_NEAR(seen.y(), 1.01875 * 0.4 + 0.01 * (0.25 + 0.32) - 2 * 0.02 * 0.12, 1e-15);
}

TEST(Lens, BeyondAFoldNothingIsSeen) {
  // r − .5 r³ turns at r = √(2/3), at .5443.
  const Distortion lens{-0.5, 0.0, 0.0, 0.0, 0.0};
  EXPECT_TRUE(undistorted(lens, Vector2d(0.54, 0.0)).has_value());
  EXPECT_FALSE(undistorted(lens, Vector2d(0.55, 0.0)).has_value());
  // What comes again behind the fold is not taken: r − 2 r³ + 1.4 r⁵ is .5 at .985 alone.
  const Distortion twice{-2.0, 1.4, 0.0, 0.0, 0.0};
  EXPECT_NEAR(distorted(twice, Vector2d(0.98558, 0.0)).x(), 0.37, 0.2);
  EXPECT_FALSE(undistorted(twice, Vector2d(0.5, 0.0)).has_value());
}

TEST(Lens, AFoldInsideTheImageIsNamed) {
  const splat::Camera narrow = camera_of(640, 480, 1000.0);
  const Distortion lens{-0.5, 0.0, 0.0, 0.0, 0.0};
  EXPECT_NO_THROW(check_distortion(lens, narrow, "cams.json: image 3"));
  try {
    check_distortion(lens, camera_of(640, 480, 500.0), "cams.json: image 3");
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr("cams.json: image 3 has a lens distortion (k1 = -0.5"));
    EXPECT_THAT(error.what(), HasSubstr("folds over inside the image"));
  }
  const Distortion broken{std::nan(""), 0.0, 0.0, 0.0, 0.0};
  EXPECT_THROW(check_distortion(broken, narrow, "a"), Error);
}

/// A pattern of the world drawn through the lens, undistorted, is the pattern drawn by a pinhole.
TEST(Lens, AnUndistortedImageIsThatOfAPinhole) {
  const splat::Camera camera = camera_of(160, 120, 130.0);
  const auto pattern = [](const Vector2d& d) {
    return 127.5 + 100.0 * std::sin(4.0 * d.x() + 2.0) * std::cos(3.0 * d.y());
  };
  for (const Distortion& lens : lenses()) {
    std::vector<std::uint8_t> taken;
    std::vector<double> expected;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const Vector2d d((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy);
        const auto ideal = undistorted(lens, d);
        ASSERT_TRUE(ideal.has_value());
        taken.push_back(static_cast<std::uint8_t>(std::lround(pattern(*ideal))));
        expected.push_back(pattern(d));
      }
    }
    const Undistortion undistortion(camera, lens);
    const auto seen = undistortion.seen();
    const auto image = undistortion.resampled(taken);
    std::size_t unseen = 0;
    for (std::size_t i = 0; i < image.size(); ++i) {
      if (seen[i] == 0) {
        ++unseen;
        EXPECT_EQ(image[i], 0);
      } else {
        ASSERT_NEAR(image[i], expected[i], 2.0) << "pixel " << i << " k1 " << lens.k1;
      }
    }
    // A pincushion pulls the edge of the pinhole's image out of the lens'.
    if (lens.k1 == 0.2) {
      EXPECT_GT(unseen, image.size() / 50);
    }
    if (lens.k1 == -0.28) {
      EXPECT_EQ(unseen, 0U);
    }
    if (lens.none()) {
      EXPECT_EQ(unseen, 0U);
      EXPECT_EQ(image, taken);
      EXPECT_EQ(undistortion.farthest(), 0.0);
    }
  }
}

TEST(Lens, HowFarAnEdgeMovesIsSaid) {
  // On the axis of an image of 200 pixels, f = 100: the edge at x' = 1 is x + .1 x³ = 1, x = .9217.
  splat::Camera camera;
  camera.width = 200;
  camera.height = 2;
  camera.fx = camera.fy = 100.0;
  camera.cx = 100.0;
  camera.cy = 1.0;
  const Undistortion undistortion(camera, {0.1, 0.0, 0.0, 0.0, 0.0});
  EXPECT_NEAR(undistortion.farthest(), 7.83, 0.01);
}

/// A lens that turns back farther out than the image reaches, but inside of the pinhole's.
TEST(Lens, BehindAFoldThePinholesImageIsUnknown) {
  const splat::Camera camera = camera_of(200, 150, 190.0);
  const Distortion lens{-0.9, 0.75, -0.2, 0.0, 0.0};
  ASSERT_NO_THROW(check_distortion(lens, camera, "a"));
  const auto seen = Undistortion(camera, lens).seen();
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Vector2d d((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy);
      const auto again = undistorted(lens, distorted(lens, d));
      const bool same = again && (*again - d).norm() < 1e-9;
      if (seen[std::size_t(y * camera.width + x)] != 0) {
        EXPECT_TRUE(same) << x << " " << y;
      }
    }
  }
}

}  // namespace
}  // namespace matterfit::capture
