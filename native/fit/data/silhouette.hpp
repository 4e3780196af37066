// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "splat/camera.hpp"

/// Outlines in images: what of a mask a fit compares, and how well two of them agree.
namespace matterfit::fit {

/// Coverage by the body, 0 to 1, row-major.
struct Coverage {
  int width = 0;
  int height = 0;
  std::vector<float> values;
};

/// A matte (0 to 255) in pixels `factor` times as large, each the mean of its own; what is left
/// over at the right and below is cut off. `factor` is at least 1 and at most the shorter edge.
[[nodiscard]] Coverage reduced(std::span<const std::uint8_t> matte, int width, int height,
                               int factor);
/// The camera that takes such an image.
[[nodiscard]] splat::Camera reduced(const splat::Camera& camera, int factor);

/// What is drawn, as far as the recording's lens saw it: times `seen` (one a pixel of the matte;
/// empty: all).
[[nodiscard]] Coverage seen_of(const std::vector<float>& mask, const Coverage& matte,
                               const std::vector<float>& seen);

/// Convolves with a Gaussian of that standard deviation [pixels]; black lies around the image.
void blur(Coverage& image, double deviation);

/// How much a coverage changes by the noise of an outline: an edge that is blurred by `blur` pixels
/// and known to `noise` pixels (standard deviation), independently from pixel to pixel along it,
/// gives squares of this size: over the pixels across it they sum up to (displacement / noise)².
///   ∫ (∂M/∂n)² dn = 1 / (2 √π blur),  so σ = noise / √(2 √π blur).
[[nodiscard]] double coverage_deviation(double noise, double blur);

/// Length of the outlines in an image [pixels]: Σ |∇M|.
[[nodiscard]] double outline_length(const Coverage& image);

/// How a simulated mask agrees with a matte, both cut at ½.
struct Agreement {
  double iou = 0.0;  ///< area of both over that of either; NaN where both are empty
  double contour_px =
      0.0;  ///< mean distance between the outlines, both ways [pixels]; NaN: one has none
  std::size_t outside = 0;  ///< pixels of the simulation alone
  std::size_t missing = 0;  ///< pixels of the matte alone
};

/// A matte as agreement() needs it: what it covers, cut at ½, and its outline. It takes memory by
/// the length of the outline and not by the size of the image.
class Silhouette {
 public:
  /// `matte` 0 to 255, row-major. Throws Error(kInput) where it is of another size.
  Silhouette(std::span<const std::uint8_t> matte, int width, int height);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// One a pixel: whether it is covered.
  [[nodiscard]] std::vector<std::uint8_t> covered() const;

 private:
  friend Agreement agreement(std::span<const float> mask, const Silhouette& matte);
  int width_;
  int height_;
  std::vector<std::uint32_t> turns_;  ///< pixels at which cover begins, ends, begins, …
  std::vector<Eigen::Vector2f> outline_;
};

/// Throws Error(kInput) where the sizes differ.
[[nodiscard]] Agreement agreement(std::span<const float> mask, const Silhouette& matte);

}  // namespace matterfit::fit
