// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "splat/camera.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::splat {

/// Camera and options in the numbers that the projection reads.
struct View {
  double rotation[3][3];
  double translation[3];
  double centre[3];  ///< of the camera, in the world
  double focal[2];
  double principal[2];
  double low[2];  ///< bounds of t_x/t_z, t_y/t_z in the Jacobian
  double high[2];
  double blur;
  double near_plane;
  bool antialiased;
  int width;
  int height;

  View() = default;
  View(const Camera& camera, const RenderOptions& options);
};

inline View::View(const Camera& camera, const RenderOptions& options)
    : focal{camera.fx, camera.fy},
      principal{camera.cx, camera.cy},
      blur(options.blur),
      near_plane(options.near_plane),
      antialiased(options.antialiased),
      width(camera.width),
      height(camera.height) {
  const Vec3d eye = camera.centre();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rotation[i][j] = camera.rotation(i, j);
    translation[i] = camera.translation[i];
    centre[i] = eye[i];
  }
  const double size[2] = {static_cast<double>(camera.width), static_cast<double>(camera.height)};
  for (int k = 0; k < 2; ++k) {
    low[k] = (-kClampMargin * size[k] - principal[k]) / focal[k];
    high[k] = ((1.0 + kClampMargin) * size[k] - principal[k]) / focal[k];
  }
}

}  // namespace matterfit::splat
