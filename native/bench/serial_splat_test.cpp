// SPDX-License-Identifier: GPL-3.0-or-later
// The rasteriser's yardstick computes what the rasteriser computes, to single precision.
#include "bench/serial_splat.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>

#include "bench/splat_scene.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::bench {
namespace {

struct Difference {
  double square = 0.0;
  double size = 0.0;
  void add(float value, float expected) {
    const double difference = static_cast<double>(value) - static_cast<double>(expected);
    square += difference * difference;
    size += static_cast<double>(expected) * static_cast<double>(expected);
  }
  [[nodiscard]] double relative() const { return std::sqrt(square / size); }
};

TEST(SerialSplat, AgreesWithTheRasteriser) {
  for (const SplatScene kind : {SplatScene::kObject, SplatScene::kSurfels, SplatScene::kTrained}) {
    const splat::Gaussians scene = splat_scene(kind, 2000);
    const splat::Camera camera = splat_camera(120);
    const splat::Image loss = splat_loss(120);
    splat::Rasteriser rasteriser(std::make_shared<Arena>(1));
    const SerialSplat::Channels expected = serial_channels(rasteriser.render(scene, camera));
    splat::GaussianGradients gradients;
    rasteriser.backward(scene, loss, gradients);
    SerialSplat serial = serial_splat(scene, camera);
    const SerialSplat::Channels& image = serial.render();
    for (std::size_t c = 0; c < 5; ++c) {
      Difference difference;
      for (std::size_t i = 0; i < image[c].size(); ++i) difference.add(image[c][i], expected[c][i]);
      EXPECT_LT(difference.relative(), 1e-3) << c;
    }
    EXPECT_GT(serial.visible_pairs(), 10 * scene.size());
    const auto& bars = serial.backward(serial_channels(loss));
    std::array<Difference, 5> differences;
    for (std::size_t i = 0; i < bars.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto row = static_cast<Eigen::Index>(k);
        differences[0].add(bars[i].mean[k], gradients.means[i][row]);
        differences[1].add(bars[i].log_scale[k], gradients.log_scales[i][row]);
        differences[2].add(bars[i].sh[k], gradients.sh[3 * i + k]);
      }
      for (std::size_t k = 0; k < 4; ++k) {
        differences[3].add(bars[i].rotation[k],
                           gradients.rotations[i][static_cast<Eigen::Index>(k)]);
      }
      differences[4].add(bars[i].opacity, gradients.opacities[i]);
    }
    for (std::size_t k = 0; k < differences.size(); ++k) {
      EXPECT_LT(differences[k].relative(), 1e-2) << k;
    }
    double largest = 0.0;
    for (const double value : gradients.pose) largest = std::max(largest, std::abs(value));
    for (std::size_t k = 0; k < 6; ++k) {
      EXPECT_NEAR(static_cast<double>(serial.pose()[k]), gradients.pose[k], 1e-2 * largest) << k;
    }
  }
}

}  // namespace
}  // namespace matterfit::bench
