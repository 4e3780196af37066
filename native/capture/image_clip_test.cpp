// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/image_clip.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "capture/colmap_for_test.hpp"
#include "capture/png.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// An image whose alpha covers the pixels x < `covered`.
void write_image(const fs::path& path, int covered, int width = 8, int height = 6,
                 bool alpha = true) {
  Bitmap bitmap(width, height);
  bitmap.has_alpha = alpha;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      bitmap.rgba[4 * std::size_t(y * width + x) + 3] = x < covered ? 255 : 0;
    }
  }
  write_png(path, bitmap);
}

/// Two cameras a metre apart, `frames` images of each.
CameraSet two_cameras(int frames) {
  CameraSet set;
  for (int k = 0; k < 2; ++k) {
    splat::Camera camera;
    camera.width = 8;
    camera.height = 6;
    camera.fx = camera.fy = 10.0;
    camera.cx = 4.0;
    camera.cy = 3.0;
    camera.translation = Vec3d(k, 0, 4);
    set.cameras.push_back(camera);
    for (int t = 0; t < frames; ++t) {
      Shot shot;
      shot.image = "c" + std::to_string(k) + "_" + std::to_string(t) + ".png";
      shot.camera = std::size_t(k);
      set.shots.push_back(shot);
    }
  }
  return set;
}

/// A clip with all its images.
struct WholeClip : ImageClip {
  std::vector<Sight> sights;
};

class ImageClipTest : public ::testing::Test {
 protected:
  /// The clip of a set whose images cover a half, after `change` has spoilt it.
  WholeClip read(const CameraSet& set, const std::function<void()>& change = {}) {
    for (const Shot& shot : set.shots) write_image(folder_ / shot.image, 4);
    if (change) change();
    write_file(folder_ / "transforms.json", format_cameras(set));
    statements_.clear();
    return read_all(folder_ / "transforms.json");
  }
  WholeClip read_all(const fs::path& cameras) {
    std::vector<Sight> sights;
    const auto take = [&](const ImageClip& clip, Sight sight) {
      EXPECT_LT(sight.camera, clip.cameras.size());
      EXPECT_LT(sight.frame, clip.times.size());
      sights.push_back(std::move(sight));
    };
    ImageClip clip = read_image_clip(cameras, options_, statements_, take);
    return {std::move(clip), std::move(sights)};
  }
  std::string message_of(const CameraSet& set, const std::function<void()>& change = {}) {
    try {
      (void)read(set, change);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      return error.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return "";
  }

  const Folder scratch_;
  const fs::path folder_ = scratch_.path;
  ImageClipOptions options_;
  std::vector<std::string> statements_;
};

TEST_F(ImageClipTest, ACameraWithoutImagesIsNamed) {
  const std::string message = message_of(two_cameras(3), [&] {
    for (const char* image : {"c1_1.png", "c1_2.png"}) fs::remove(folder_ / image);
  });
  EXPECT_THAT(message, HasSubstr("2 of the 3 images of camera 1 are not there"));
  EXPECT_THAT(message, HasSubstr("c1_1.png"));
  EXPECT_THAT(message, HasSubstr("'images'"));
}

TEST_F(ImageClipTest, MattesStandByTimeAndCamera) {
  options_.fps = 10.0;
  options_.unit = 0.01;
  const WholeClip clip = read(two_cameras(3));
  EXPECT_THAT(clip.times, ElementsAre(0.0, 0.1, 0.2));
  ASSERT_EQ(clip.sights.size(), 6U);
  EXPECT_EQ(clip.sights[1].camera, 1U);
  EXPECT_EQ(clip.sights[2].frame, 1U);
  EXPECT_EQ(clip.sights[0].matte[3], 255);
  EXPECT_EQ(clip.sights[0].matte[4], 0);
  EXPECT_NEAR(clip.cameras[1].centre().norm(), 0.01 * std::sqrt(17.0), 1e-12);
  EXPECT_THAT(statements_, IsEmpty());
}

TEST_F(ImageClipTest, TimesOfTheFileAreTaken) {
  CameraSet set = two_cameras(2);
  for (std::size_t i = 0; i < 4; ++i) set.shots[i].time = i % 2 == 0 ? 0.25 : 0.5;
  EXPECT_THAT(read(set).times, ElementsAre(0.25, 0.5));
}

TEST_F(ImageClipTest, ClocksOfCamerasMayDifferALittle) {
  options_.fps = 10.0;
  CameraSet set = two_cameras(3);
  for (std::size_t i = 0; i < 6; ++i) {
    set.shots[i].time = 0.1 * double(i % 3) + (i < 3 ? 0.0 : 0.004);
  }
  const WholeClip clip = read(set);
  EXPECT_THAT(clip.times, ElementsAre(0.0, 0.1, 0.2));
  EXPECT_EQ(clip.sights.size(), 6U);
}

TEST_F(ImageClipTest, AMatteOfItsOwnFileIsTakenByItsBrightness) {
  CameraSet set = two_cameras(1);
  set.shots[0].mask = "mask.png";
  const auto change = [&] {
    Bitmap mask(8, 6);
    for (std::size_t i = 0; i < mask.rgba.size(); ++i) mask.rgba[i] = i % 32 < 8 ? 255 : 0;
    write_png(folder_ / "mask.png", mask);
  };
  const WholeClip clip = read(set, change);
  EXPECT_EQ(clip.sights[0].matte[1], 255);
  EXPECT_EQ(clip.sights[0].matte[2], 0);
}

/// A background of one colour, and the body's where x < `covered`.
void write_colours(const fs::path& path, int covered) {
  Bitmap bitmap(8, 6);
  for (std::size_t i = 0; i < bitmap.pixels(); ++i) {
    const bool body = int(i % 8) < covered;
    for (std::size_t c = 0; c < 3; ++c) {
      bitmap.rgba[4 * i + c] = static_cast<std::uint8_t>(body ? 200 - 20 * c : 60 + 10 * c);
    }
    bitmap.rgba[4 * i + 3] = 255;
  }
  write_png(path, bitmap);
}

TEST_F(ImageClipTest, ColoursAreReadWhereTheyAreAskedFor) {
  CameraSet set = two_cameras(1);
  set.shots[0].mask = "mask.png";
  const auto change = [&] {
    write_image(folder_ / "mask.png", 3);
    write_colours(folder_ / set.shots[0].image, 5);
  };
  EXPECT_THAT(read(set, change).sights[0].colours[0], IsEmpty());
  options_.colours = true;
  const WholeClip clip = read(set, change);
  EXPECT_EQ(clip.sights[0].matte[3], 0) << "of the matte's own file";
  EXPECT_EQ(clip.sights[0].colours[0][4], 200);
  EXPECT_EQ(clip.sights[0].colours[2][4], 160);
  EXPECT_EQ(clip.sights[0].colours[1][5], 70);
  EXPECT_EQ(clip.sights[1].colours[2].size(), 48U);
}

TEST_F(ImageClipTest, MattesAreWhatDiffersFromACleanPlate) {
  const CameraSet set = two_cameras(2);
  const auto change = [&] {
    for (const Shot& shot : set.shots) write_colours(folder_ / shot.image, 3 + int(shot.camera));
    write_colours(folder_ / "plate_00.png", 0);
    write_colours(folder_ / "plate_01.png", 0);
  };
  options_.plates = ClipPlates{{folder_ / "plate_##.png"}, 6.0};
  const WholeClip by_pattern = read(set, change);
  options_.plates->files = {folder_ / "plate_00.png", folder_ / "plate_01.png"};
  const WholeClip by_list = read(set, change);
  for (const WholeClip* clip : {&by_pattern, &by_list}) {
    for (const Sight& sight : clip->sights) {
      const std::size_t last = 2 + sight.camera;
      EXPECT_EQ(sight.matte[8 + last], 255) << sight.image;
      EXPECT_EQ(sight.matte[8 + last + 1], 0) << sight.image;
    }
  }
  options_.plates->files.resize(1);
  EXPECT_THAT(message_of(set, change), HasSubstr("there are 1 clean plates and 2 cameras"));
  options_.plates->files.resize(3, folder_ / "plate_00.png");
  EXPECT_THAT(message_of(set, change), HasSubstr("there are 3 clean plates and 2 cameras"));
  options_.plates->files = {folder_ / "other_#.png"};
  EXPECT_THAT(message_of(set, change), HasSubstr("other_0.png"));
}

TEST_F(ImageClipTest, ALensIsUndistortedAndWhatItDidNotSeeIsMarked) {
  CameraSet set = two_cameras(1);
  set.lenses = {Distortion{}, Distortion{0.4, 0.0, 0.0, 0.0, 0.0}};
  for (splat::Camera& camera : set.cameras) camera.fx = camera.fy = 5.0;
  const WholeClip clip = read(set);
  EXPECT_THAT(clip.seen[0], IsEmpty());
  ASSERT_EQ(clip.seen[1].size(), 48U);
  // The corner's ray, (.7, .5), is seen at 1.296 times that: 8.5 pixels from the left edge's 0.
  EXPECT_EQ(clip.seen[1][0], 0);
  EXPECT_EQ(clip.seen[1][3 * 8 + 4], 255);
  EXPECT_EQ(clip.sights[1].matte[0], 0);
  EXPECT_EQ(clip.sights[1].matte[3 * 8 + 2], 255);
  EXPECT_EQ(clip.sights[1].matte[3 * 8 + 5], 0);
  EXPECT_THAT(statements_, ElementsAre(HasSubstr("Camera 1: its lens is undistorted, by up to")));
  EXPECT_THAT(statements_[0], HasSubstr("% of its image are not seen by it"));
}

TEST_F(ImageClipTest, ImagesOfAColmapModelThatWereNotFoundAreNamed) {
  const ColmapFiles model = colmap_text(two_cameras(2));
  write_file(folder_ / "sparse/cameras.txt", model.cameras);
  write_file(folder_ / "sparse/images.txt", model.images);
  const auto message = [&]() -> std::string {
    try {
      (void)read_all(folder_);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was thrown";
  };
  EXPECT_THAT(message(), HasSubstr("its images were not found: 'c0_0.png' lies neither"));
  for (const Shot& shot : two_cameras(2).shots) write_image(folder_ / "takes" / shot.image, 4);
  options_.images = folder_ / "takes";
  EXPECT_EQ(read_all(folder_).sights.size(), 4U);
}

TEST_F(ImageClipTest, WhatIsMissingOrEmptyIsStated) {
  CameraSet set = two_cameras(3);
  set.shots.pop_back();
  (void)read(set, [&] { write_image(folder_ / "c0_1.png", 0); });
  EXPECT_THAT(
      statements_,
      ElementsAre(HasSubstr("camera 0: the mattes of 1 of its 3 images are empty, c0_1.png the "),
                  HasSubstr("camera 1 has 2 images of 3 times")));
}

TEST_F(ImageClipTest, WhatIsBrokenIsNamed) {
  const CameraSet set = two_cameras(2);
  EXPECT_THAT(message_of(set, [&] { fs::remove(folder_ / "c1_0.png"); }), HasSubstr("c1_0.png"));
  EXPECT_THAT(message_of(set, [&] { write_image(folder_ / "c1_1.png", 4, 9, 6); }),
              HasSubstr("is 9 × 6 pixels, its camera's images are 8 × 6"));
  EXPECT_THAT(message_of(set, [&] { write_image(folder_ / "c0_0.png", 4, 8, 6, false); }),
              HasSubstr("c0_0.png: has no matte"));
  EXPECT_THAT(message_of(set, [&] { write_image(folder_ / "c0_1.png", 8); }),
              HasSubstr("its matte covers the whole image"));
  EXPECT_THAT(message_of(set,
                         [&] {
                           for (const Shot& shot : set.shots) write_image(folder_ / shot.image, 0);
                         }),
              HasSubstr("all mattes are empty"));
  CameraSet twice = set;
  twice.shots[1].image = "again_0.png";
  EXPECT_THAT(message_of(twice), HasSubstr("are of one camera and one time"));
  CameraSet unnumbered = set;
  unnumbered.shots[2].image = "still.png";
  EXPECT_THAT(message_of(unnumbered), HasSubstr("neither a 'time' nor a number"));
}

}  // namespace
}  // namespace matterfit::capture
