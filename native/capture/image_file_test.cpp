// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/image_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "capture/exr_for_test.hpp"

namespace matterfit::capture {
namespace {

using ::testing::HasSubstr;

TEST(ImageFile, TheFormatIsToldByTheContent) {
  const Folder folder;
  Bitmap bitmap(5, 3);
  bitmap.rgba[0] = 77;
  const auto png = folder.path / "image.jpg";
  write_png(png, bitmap);
  EXPECT_EQ(read_image(png).rgba[0], 77);
  EXPECT_EQ(image_size(png), (std::array<int, 2>{5, 3}));
  const auto exr = folder.path / "image.png";
  write_exr(exr, {7, 4, 0, false}, {"Y"}, [](const std::string&, int, int) { return 1.0; });
  EXPECT_EQ(read_image(exr).rgba[0], 255);
  EXPECT_EQ(image_size(exr), (std::array<int, 2>{7, 4}));
  write_file(folder.path / "a.tif", "II*");
  for (const auto& read : {+[](const std::filesystem::path& p) { (void)read_image(p); },
                           +[](const std::filesystem::path& p) { (void)image_size(p); }}) {
    try {
      read(folder.path / "a.tif");
      ADD_FAILURE() << "nothing was thrown";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("a.tif: is no image that is read: PNG, JPEG or OpenEXR"));
    }
  }
}

}  // namespace
}  // namespace matterfit::capture
