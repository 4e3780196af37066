// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <random>

#include "splat/rasteriser.hpp"

namespace matterfit::splat {

/// Looks at the origin from `distance` away, turned, with its principal point off the centre.
inline Camera camera_for_test(int width, int height, double distance = 2.5) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = 1.3 * width;
  camera.fy = 1.2 * width;
  camera.cx = 0.5 * width + 1.7;
  camera.cy = 0.5 * height - 2.3;
  camera.rotation = Eigen::AngleAxisd(0.8, Vec3d(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
  camera.translation = Vec3d(0.05, -0.03, distance);
  return camera;
}

/// Gaussians of many sizes, shapes and opacities in a ball of radius ½ about the origin.
inline Gaussians gaussians_for_test(std::size_t count, int sh_degree, bool deformed,
                                    unsigned seed = 7) {
  std::mt19937 engine(seed);
  const auto uniform = [&](double low, double high) {
    return static_cast<float>(low + (high - low) * static_cast<double>(engine()) / 4294967296.0);
  };
  Gaussians g;
  g.sh_degree = sh_degree;
  for (std::size_t i = 0; i < count; ++i) {
    Vec3f p;
    do {
      p = Vec3f(uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-0.5, 0.5));
    } while (p.norm() > 0.5F);
    g.means.push_back(p);
    const double size = uniform(std::log(0.008), std::log(0.05));
    g.log_scales.emplace_back(uniform(size - 1.2, size + 0.4), uniform(size - 1.2, size + 0.4),
                              uniform(size - 1.2, size + 0.4));
    g.rotations.emplace_back(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    g.opacities.push_back(i % 10 == 0 ? 1.0F : uniform(0.02, 0.98));
    for (std::size_t band = 0; band < sh_bands(sh_degree); ++band) {
      const double spread = band == 0 ? 1.5 : 0.3;
      for (int c = 0; c < 3; ++c) g.sh.push_back(uniform(-spread, spread));
    }
    if (deformed) {
      Mat3f f = Mat3f::Identity();
      for (int k = 0; k < 9; ++k) f(k / 3, k % 3) += uniform(-0.3, 0.3);
      g.deformation_gradients.push_back(f);
    }
  }
  return g;
}

/// Derivatives of some loss in every channel.
inline Image loss_for_test(int width, int height, unsigned seed = 11) {
  std::mt19937 engine(seed);
  Image loss(width, height);
  const auto fill = [&](std::vector<float>& channel) {
    for (float& value : channel) {
      value = static_cast<float>(static_cast<double>(engine()) / 2147483648.0 - 1.0);
    }
  };
  fill(loss.colour);
  fill(loss.mask);
  fill(loss.depth);
  return loss;
}

}  // namespace matterfit::splat
