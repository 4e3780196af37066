// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "capture/cameras.hpp"
#include "capture/clean_plate.hpp"
#include "capture/colour_key.hpp"
#include "splat/camera.hpp"

namespace matterfit {
class Interrupter;
}

namespace matterfit::capture {

/// What one camera saw at one time.
struct Sight {
  std::size_t camera = 0;           ///< in ImageClip::cameras
  std::size_t frame = 0;            ///< in ImageClip::times
  std::vector<std::uint8_t> matte;  ///< coverage by the body, 0 to 255, row-major
  std::string image;                ///< the file's name, for messages
  /// Red, green and blue, sRGB, each as the matte is; empty where they were not asked for.
  std::array<std::vector<std::uint8_t>, 3> colours;
};

/// A recording by images: cameras in metres, Z up. Its images are large and many, so they are read
/// one after another. What a lens distorts is undistorted: mattes are those of pinholes, of the
/// files' sizes.
struct ImageClip {
  std::vector<splat::Camera> cameras;
  /// For each camera: 255 where its lens saw what its pinhole would, else 0, and the mattes are 0
  /// there too. Empty: it saw all of it.
  std::vector<std::vector<std::uint8_t>> seen;
  std::vector<double> times;  ///< [s], strictly ascending
  std::string source;
};

/// Gets what each camera saw, by frame, then by camera, at most one image for each of both; the
/// clip is complete before the first.
using SightTaker = std::function<void(const ImageClip& clip, Sight sight)>;

/// Clean plates, one a camera.
struct ClipPlates {
  /// A file a camera, in their order; or one name whose last # (or ##, …) stands for its number.
  std::vector<std::filesystem::path> files;
  double threshold = 6.0;  ///< as CleanPlate takes it
};

struct ImageClipOptions {
  std::filesystem::path images;  ///< folder of the images; empty: as read_cameras() finds it
  double unit = 1.0;             ///< metres per unit of the cameras
  char up = 'z';  ///< axis of the cameras' world that points up, as TracksOptions has it
  Eigen::Matrix4d transform = Eigen::Matrix4d::Identity();  ///< after unit and up; a similarity
  /// Frames per second; 0: the times that the file says. Else images of one camera follow each
  /// other by their time or, where the file says none, by the number in their name.
  double fps = 0.0;
  double default_fps = 24.0;  ///< of files without times, where `fps` is 0
  /// At most one of both; without, the matte that the file names, else the image's alpha.
  std::optional<ColourKey> key;
  std::optional<ClipPlates> plates;
  bool colours = false;  ///< are read too
};

/// The files that read_image_clip() reads, each once, in its order: those of the cameras, plates,
/// images and mattes. Throws Error(kInput) where the cameras cannot be read; what is not there is
/// listed all the same.
[[nodiscard]] std::vector<std::filesystem::path> image_clip_files(
    const std::filesystem::path& cameras, const ImageClipOptions& options);

/// Cameras as read_cameras() reads them; `take` gets all images with their mattes. `statements`
/// gets what is odd and no error: images that one camera lacks, empty mattes. Throws Error(kInput)
/// that names file and reason: an image without a matte, or of another size than its camera's,
/// images of one camera that have one time, a matte that covers its whole image, mattes that are
/// all empty, cameras without a plate; Cancelled before an image where `interrupter` (null: none)
/// says so.
ImageClip read_image_clip(const std::filesystem::path& cameras, const ImageClipOptions& options,
                          std::vector<std::string>& statements, const SightTaker& take,
                          const Interrupter* interrupter = nullptr);

}  // namespace matterfit::capture
