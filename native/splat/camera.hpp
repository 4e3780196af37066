// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/vec.hpp"

namespace matterfit::splat {

/// A pinhole camera. Lens distortion is not its matter: images are undistorted before they are
/// compared with what it draws.
///
/// Camera axes: x right, y down, z forward (OpenCV's, COLMAP's). A point x of the world lies at
/// t = rotation · x + translation and is seen at pixel coordinates
/// (fx t_x / t_z + cx, fy t_y / t_z + cy). The image covers [0, width] × [0, height]; the pixel in
/// column i of row j is sampled at its centre, (i + ½, j + ½). Row 0 is on top.
struct Camera {
  int width = 0;
  int height = 0;
  double fx = 0.0;  ///< [pixels]
  double fy = 0.0;
  double cx = 0.0;  ///< principal point in pixel coordinates: width / 2 when centred
  double cy = 0.0;
  Mat3d rotation = Mat3d::Identity();  ///< world to camera, orthonormal, det +1
  Vec3d translation = Vec3d::Zero();   ///< world to camera [m]

  /// Where it stands in the world [m].
  [[nodiscard]] Vec3d centre() const { return -(rotation.transpose() * translation); }
};

}  // namespace matterfit::splat
