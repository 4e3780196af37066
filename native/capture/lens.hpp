// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "splat/camera.hpp"

namespace matterfit::capture {

/// What a lens does to the image of a pinhole, by Brown's model as OpenCV and COLMAP write it: the
/// direction (x, y, 1) in the camera's axes is seen where a pinhole would see (x', y', 1),
///   x' = c x + 2 p1 x y + p2 (r² + 2 x²),  y' = c y + p1 (r² + 2 y²) + 2 p2 x y,
///   c = 1 + k1 r² + k2 r⁴ + k3 r⁶,  r² = x² + y².
/// Source: D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37 (1971).
struct Distortion {
  double k1 = 0.0;
  double k2 = 0.0;
  double k3 = 0.0;
  double p1 = 0.0;
  double p2 = 0.0;

  [[nodiscard]] bool none() const {
    return k1 == 0.0 && k2 == 0.0 && k3 == 0.0 && p1 == 0.0 && p2 == 0.0;
  }
};

/// (x', y') of (x, y).
[[nodiscard]] Eigen::Vector2d distorted(const Distortion& lens, const Eigen::Vector2d& ideal);
/// ∂(x', y')/∂(x, y).
[[nodiscard]] Eigen::Matrix2d distortion_slope(const Distortion& lens,
                                               const Eigen::Vector2d& ideal);
/// (x, y) of (x', y'), by Newton's method in double to 1e-14 of its size. Where the model maps
/// several places there, it is the one that belongs to the axis: between it and the axis the model
/// does not fold over (the determinant of its Jacobian is above 0). Nothing where there is none.
[[nodiscard]] std::optional<Eigen::Vector2d> undistorted(const Distortion& lens,
                                                         const Eigen::Vector2d& seen);

/// Throws Error(kInput) beginning with `where`: a coefficient that is not finite, a distortion that
/// folds over inside the image, so that part of its edge has no place that it is seen from.
void check_distortion(const Distortion& lens, const splat::Camera& camera,
                      const std::string& where);

/// Images of a lens as a pinhole with the same fx, fy, cx, cy and size would have taken them. Where
/// its image lies outside of the lens' nothing is known.
class Undistortion {
 public:
  /// `camera` and `lens` as check_distortion() accepts them.
  Undistortion(const splat::Camera& camera, const Distortion& lens);

  /// 255 for each pixel of the pinhole's image that the lens saw, else 0; row-major.
  [[nodiscard]] std::vector<std::uint8_t> seen() const;
  /// An image of one value a pixel, bilinear; 0 where nothing is known. Row-major.
  [[nodiscard]] std::vector<std::uint8_t> resampled(std::span<const std::uint8_t> image) const;
  /// How far a pixel of the image moves at most [pixels].
  [[nodiscard]] double farthest() const;

 private:
  /// Where in the lens' image a pixel of the pinhole's is seen; nothing outside of it.
  [[nodiscard]] std::optional<Eigen::Vector2d> source(int column, int row) const;

  splat::Camera camera_;
  Distortion lens_;
  bool folds_ = false;  ///< somewhere in the pinhole's image
};

}  // namespace matterfit::capture
