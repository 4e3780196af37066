// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <vector>

#include "base/random.hpp"
#include "bench/serial_splat.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::bench {

/// What the rasteriser is measured on: an object of unit size that fills about a third of a square
/// image, f = 1.15 times its width, seen from 2.75 half extents away.
enum class SplatScene {
  kObject,   ///< discs on a bumpy closed surface, opaque, 0.4 mean spacings in radius: as many
             ///< visible pairs (.8 M of 30 000 at 400²) as scans of one object have
  kSurfels,  ///< the same of 0.8 mean spacings: three and a half times as many pairs
  kTrained,  ///< like a trained scene: in a thick shell, sizes over a decade, all opacities
};

inline splat::Gaussians splat_scene(SplatScene kind, std::size_t count, std::uint64_t seed = 1) {
  Random random(seed);
  splat::Gaussians g;
  const double spacing = std::sqrt(4.0 * 3.14159 * 0.45 * 0.45 / static_cast<double>(count));
  for (std::size_t i = 0; i < count; ++i) {
    const double z = random.between(-1.0, 1.0);
    const double angle = random.between(0.0, 2.0 * 3.14159265358979);
    const double r = std::sqrt(1.0 - z * z);
    const Vec3d normal(r * std::cos(angle), r * std::sin(angle), z);
    const double bump = 1.0 + 0.12 * std::sin(5.0 * angle) * r + 0.08 * std::cos(7.0 * z);
    const bool surfel = kind != SplatScene::kTrained;
    const double radius = kind == SplatScene::kObject ? 0.4 : 0.8;
    const double shell = surfel ? 0.45 : 0.45 * std::cbrt(random.between(0.5, 1.0));
    g.means.push_back((shell * bump * normal).cast<float>());
    const double size = surfel ? radius * spacing : spacing * random.log_between(0.3, 3.0);
    const double second = surfel ? size : size * random.log_between(0.3, 1.0);
    const double third = surfel ? 0.1 * size : size * random.log_between(0.1, 1.0);
    g.log_scales.push_back(Vec3d(std::log(size), std::log(second), std::log(third)).cast<float>());
    Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Vec3d::UnitZ(), normal);
    if (!surfel) {
      turn = Eigen::Quaterniond(random.between(-1, 1), random.between(-1, 1), random.between(-1, 1),
                                random.between(-1, 1))
                 .normalized();
    }
    g.rotations.push_back(Eigen::Vector4d(turn.w(), turn.x(), turn.y(), turn.z()).cast<float>());
    g.opacities.push_back(static_cast<float>(surfel ? 0.95 : random.between(0.05, 1.0)));
    for (int c = 0; c < 3; ++c) g.sh.push_back(static_cast<float>(random.between(-1.0, 1.5)));
  }
  return g;
}

inline splat::Camera splat_camera(int size) {
  splat::Camera camera;
  camera.width = camera.height = size;
  camera.fx = camera.fy = 1.15 * size;
  camera.cx = camera.cy = 0.5 * size;
  camera.rotation = Eigen::AngleAxisd(2.0, Vec3d(0.7, 0.6, -0.2).normalized()).toRotationMatrix();
  camera.translation = Vec3d(0.0, 0.0, 1.375);
  return camera;
}

inline splat::Image splat_loss(int size) {
  Random random(5);
  splat::Image loss(size, size);
  for (auto* channel : {&loss.colour, &loss.mask, &loss.depth}) {
    for (float& value : *channel) value = static_cast<float>(random.between(-1.0, 1.0));
  }
  return loss;
}

/// The same for the yardstick.
inline SerialSplat serial_splat(const splat::Gaussians& g, const splat::Camera& camera) {
  std::vector<SerialSplat::Gaussian> all;
  all.reserve(g.size());
  for (std::size_t i = 0; i < g.size(); ++i) {
    all.push_back({{g.means[i][0], g.means[i][1], g.means[i][2]},
                   {g.log_scales[i][0], g.log_scales[i][1], g.log_scales[i][2]},
                   {g.rotations[i][0], g.rotations[i][1], g.rotations[i][2], g.rotations[i][3]},
                   g.opacities[i],
                   {g.sh[3 * i], g.sh[3 * i + 1], g.sh[3 * i + 2]}});
  }
  SerialSplat::Camera plain{camera.width,
                            camera.height,
                            static_cast<float>(camera.fx),
                            static_cast<float>(camera.fy),
                            static_cast<float>(camera.cx),
                            static_cast<float>(camera.cy),
                            {},
                            {}};
  for (int k = 0; k < 9; ++k) {
    plain.rotation[static_cast<std::size_t>(k)] = static_cast<float>(camera.rotation(k / 3, k % 3));
  }
  for (int k = 0; k < 3; ++k) {
    plain.translation[static_cast<std::size_t>(k)] = static_cast<float>(camera.translation[k]);
  }
  return SerialSplat(std::move(all), plain);
}

inline SerialSplat::Channels serial_channels(const splat::Image& image) {
  SerialSplat::Channels channels;
  const auto pixels = static_cast<std::ptrdiff_t>(image.pixels());
  for (std::ptrdiff_t c = 0; c < 3; ++c) {
    channels[static_cast<std::size_t>(c)].assign(image.colour.begin() + c * pixels,
                                                 image.colour.begin() + (c + 1) * pixels);
  }
  channels[3] = image.mask;
  channels[4] = image.depth;
  return channels;
}

}  // namespace matterfit::bench
