// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "capture/image_clip.hpp"
#include "fit/data/camera_pose.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {

/// A capture by images: cameras with mattes (docs/formats.md, "images").
struct ImagesDoc {
  std::string path;               ///< in the document: "captures[0]"
  std::size_t place = 0;          ///< in the document's list
  std::string name;               ///< by default that of the folder of the cameras' file
  std::filesystem::path cameras;  ///< transforms.json, all_data.json, or a COLMAP model
  std::string body;               ///< whose outline the mattes are; empty: of all bodies
  capture::ImageClipOptions options;
  std::optional<double> start_frame;  ///< scene frame of the recording's time 0
  double noise = 1.0;                 ///< standard deviation of an outline's place [pixels]
  std::optional<double> colours;      ///< noise of a colour (sRGB, 0 to 1); none: not compared
  struct Holdout {
    std::optional<std::array<int, 2>> frames;  ///< scene frames [a, b)
    std::vector<int> cameras;                  ///< by number
  } holdout;
  std::vector<fit::CameraPose>
      poses;  ///< of the first cameras; the others stand as their file says
  /// Standard deviations of what is known of the poses of all cameras, which are fitted; 0: that is
  /// not.
  struct Refine {
    double shift = 0.02;  ///< [m]
    double turn = 0.02;   ///< [rad]
    double focal = 0.0;   ///< a share
  };
  std::optional<Refine> refine;
};

/// The section `render`: what is drawn through which cameras.
struct RenderDoc {
  std::string path = "render";  ///< of `cameras` in the document, without that key
  std::string capture;  ///< whose cameras, world and poses are taken; empty: those given here
  std::filesystem::path cameras;
  capture::ImageClipOptions options;   ///< of the cameras' world
  std::vector<int> chosen;             ///< cameras by number; empty: all
  std::vector<fit::CameraPose> poses;  ///< as of a capture
  std::filesystem::path gaussians;     ///< a file of splats that stands still; empty: the scene
  std::optional<Eigen::AlignedBox3d> crop;  ///< of `gaussians`, as Source::crop
  double opacity_threshold = 0.0;           ///< of `gaussians`, as SplatOutput has it
  std::optional<Vec3d> background;          ///< sRGB, 0 to 1; none: transparent
};

/// The captures by images of a job, which Job::captures leaves out. read_job() has checked them.
[[nodiscard]] std::vector<ImagesDoc> images_of(const Job& job);
/// The section `render`; nothing without one. Cameras, their world and poses are those of the
/// capture that it names, if it does.
[[nodiscard]] std::optional<RenderDoc> render_of(const Job& job);

}  // namespace matterfit::job
