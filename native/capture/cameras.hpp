// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/lens.hpp"
#include "splat/camera.hpp"

namespace matterfit::capture {

/// One image of a recording.
struct Shot {
  std::string image;           ///< relative to CameraSet::folder, with its ending
  std::string mask;            ///< the same of its matte; empty: none
  std::size_t camera = 0;      ///< in CameraSet::cameras
  std::optional<double> time;  ///< as the file says it
  std::optional<int> number;   ///< the last digits of the image's name
};

/// Cameras and the images that they took. Images of equal pose and lens are of one camera; cameras
/// stand in the order in which they first appear and are called by their number.
struct CameraSet {
  /// Pinholes: what an undistorted image shows. As it was taken it is that of the lens.
  std::vector<splat::Camera> cameras;
  std::vector<Distortion> lenses;  ///< one a camera
  std::vector<Shot> shots;
  std::filesystem::path folder;    ///< of the images; empty where they were not found
  std::vector<std::string> notes;  ///< what is odd and no error
  std::string source;
};

/// How big an image is [pixels], by the name that the file gives.
using ImageSize = std::function<std::array<int, 2>(const std::string& image)>;

/// Nerfstudio's and Blender-NeRF's `transforms.json` (an object with `frames`: `file_path`,
/// `transform_matrix`, optional `mask_path`, `time`; lens for all or for each frame: `fl_x`, `fl_y`
/// or `camera_angle_x`, `camera_angle_y` [rad], `cx`, `cy`, `w`, `h`, `k1`, `k2`, `k3`, `p1`, `p2`,
/// `camera_model`), and PAC-NeRF's `all_data.json` (a list of `file_path`, `c2w` 3×4, `intrinsic`
/// 3×3, `time`). In both matrices map the camera's axes (OpenGL's and Blender's: x right, y up,
/// looking along −z) to the world, of which nothing is turned here. A name without an ending is
/// taken as .png. `size` is asked where the file does not say it. Throws Error(kInput) beginning
/// with `name` and the frame: no images, a matrix that is no rigid motion, a focal length that is
/// none, a camera's model that is not read, a distortion that folds over inside the image, sizes
/// that differ within a camera.
[[nodiscard]] CameraSet parse_cameras(std::string_view text, const std::string& name,
                                      const ImageSize& size);
/// Reads a file as above, whose images lie in `images` or, where that is empty, beside it; or a
/// COLMAP model (capture/colmap.hpp), a folder or one of its files.
[[nodiscard]] CameraSet read_cameras(const std::filesystem::path& path,
                                     const std::filesystem::path& images = {});

/// `transforms.json` of these, with every lens written out; parse_cameras() gives them back.
[[nodiscard]] std::string format_cameras(const CameraSet& set);

/// The camera in another world, x' = matrix · x, a rotation with a scale and a shift. Throws
/// Error(kInput) for any other matrix.
[[nodiscard]] splat::Camera moved(const splat::Camera& camera, const Eigen::Matrix4d& matrix);

}  // namespace matterfit::capture
