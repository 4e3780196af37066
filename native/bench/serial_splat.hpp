// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace matterfit::bench {

/// The yardstick of the rasteriser: the image formation of splat/rasteriser.hpp and its adjoint as
/// one writes them down in plain serial C++, float, harmonics of degree 0. Gaussians are sorted by
/// depth and drawn one after another over the pixels of the box that holds α ≥ 1/255; no tiles,
/// nothing vectorised by hand. The backward pass goes front to back too and keeps per pixel what is
/// still behind. Compiled with -O3 -march=native.
class SerialSplat {
 public:
  struct Gaussian {
    std::array<float, 3> mean;       ///< [m]
    std::array<float, 3> log_scale;  ///< ln [m]
    std::array<float, 4> rotation;   ///< w x y z
    float opacity;
    std::array<float, 3> sh;  ///< of band 0
  };
  struct Camera {
    int width;
    int height;
    float fx;
    float fy;
    float cx;
    float cy;
    std::array<float, 9> rotation;  ///< world to camera, row-major
    std::array<float, 3> translation;
  };
  /// Red, green, blue, mask, depth, row-major each.
  using Channels = std::array<std::vector<float>, 5>;

  SerialSplat(std::vector<Gaussian> gaussians, const Camera& camera);

  const Channels& render();
  /// Derivatives in the last image's Gaussians, with `loss` those in its channels.
  const std::vector<Gaussian>& backward(const Channels& loss);
  /// (ω, τ) of splat::GaussianGradients::pose, after backward().
  [[nodiscard]] const std::array<float, 6>& pose() const { return pose_; }

  /// Pairs of a Gaussian and a pixel with α ≥ 1/255 in front of the last image's stop.
  [[nodiscard]] std::size_t visible_pairs() const { return visible_pairs_; }

 private:
  struct Footprint {
    float mean[2];
    float depth;
    float conic[3];  ///< xx, xy, yy
    float colour[3];
    int low[2];
    int high[2];
  };
  struct Sums {
    float mean[2];
    float conic[3];
    float log_alpha;
    float colour[3];
    float depth;
  };
  bool project(const Gaussian& g, Footprint& f) const;
  void project_back(const Gaussian& g, const Footprint& f, const Sums& sums, Gaussian& bar);
  /// α of a pixel, or 0.
  static float alpha_of(const Footprint& f, float opacity, float dx, float dy, bool& clamped);

  std::vector<Gaussian> gaussians_;
  Camera camera_;
  std::vector<Footprint> footprints_;
  std::vector<std::uint32_t> order_;
  Channels channels_;
  std::vector<float> transmittance_;
  std::vector<float> behind_;
  std::vector<Gaussian> gradients_;
  std::array<float, 6> pose_{};
  std::size_t visible_pairs_ = 0;
};

}  // namespace matterfit::bench
