// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "capture/matte_region.hpp"
#include "capture/png.hpp"

namespace matterfit::capture {

/// A matte of a body by what differs from a clean plate, an image by the same camera that does not
/// show the body. Colours are compared as light (linear), each difference against its standard
/// deviation σ. The plate's own noise gives σ: of light of equal brightness, the median of what a
/// Laplacian leaves of it (J. Immerkær, "Fast noise variance estimation", Computer Vision and Image
/// Understanding 64 (1996)), √2 times it for the noise of both images, and at least one step of
/// eight bits. A shadow, or light that has changed, differs as well.
class CleanPlate {
 public:
  /// Differences above `threshold` standard deviations, over the three colours, are of the body:
  /// above 6 lies one pixel in 10⁷ by chance. Throws Error(kInput) for a plate below 3 × 3 pixels.
  explicit CleanPlate(const Bitmap& plate, double threshold = 6.0);

  /// Coverage, 0 to 255, row-major; of the regions that differ only the largest is kept. Along its
  /// edge, two pixels wide, a pixel's colour is a mixture: α = (C − B)·(F − B)/|F − B|², B the
  /// plate's colour there, F the colour of the body farther inside. Throws Error(kInput) for an
  /// image of another size.
  [[nodiscard]] BodyMatte matte(const Bitmap& image) const;

  /// σ of one image's light of that brightness; `channel` 0 to 2.
  [[nodiscard]] double noise(std::size_t channel, double light) const;

 private:
  /// Noise by brightness, ascending; between two of them it is interpolated.
  struct Level {
    double light;
    double deviation;
  };
  /// Whether the colour differs, of each pixel: 255 or 0.
  [[nodiscard]] std::vector<std::uint8_t> different(const Bitmap& image) const;

  Bitmap plate_;
  double threshold_;
  std::array<std::vector<Level>, 3> levels_;
  std::array<std::array<double, 256>, 3> deviations_{};  ///< of a difference, by the plate's value
};

}  // namespace matterfit::capture
