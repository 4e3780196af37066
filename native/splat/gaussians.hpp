// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::splat {

inline constexpr int kMaxShDegree = 3;

/// Real spherical harmonics up to a degree: (degree + 1)².
[[nodiscard]] constexpr std::size_t sh_bands(int degree) {
  const auto orders = static_cast<std::size_t>(degree) + 1;
  return orders * orders;
}

/// Anisotropic Gaussians in the quantities that an optimiser moves. The covariance is
/// Σ' = F R S² Rᵀ Fᵀ with R of the quaternion, S = exp(log_scales) and F the deformation gradient.
struct Gaussians {
  int sh_degree = 0;                       ///< 0 to 3
  std::vector<Vec3f> means;                ///< (N) where they are now, F applied or not [m]
  std::vector<Vec3f> log_scales;           ///< (N) ln of the standard deviations [m]
  std::vector<Eigen::Vector4f> rotations;  ///< (N) w x y z, of any length but 0
  std::vector<float> opacities;            ///< (N) in [0, 1]
  /// (N, (degree + 1)², 3), coefficient-major: [i][band][rgb]; order and signs of Kerbl et al.
  /// 2023. Colour = max(0, ½ + Σ sh Y(d)), d from the camera's centre to the mean, in world axes:
  /// who turns a body turns its coefficients (capture/spherical_harmonics.hpp), F does not.
  std::vector<float> sh;
  std::vector<Mat3f> deformation_gradients;  ///< (N) F, or empty: all I

  [[nodiscard]] std::size_t size() const { return means.size(); }
};

/// Gaussians of both, in this order: of the higher degree, and with deformation gradients (I where
/// one has none) if either has some.
void append(Gaussians& into, const Gaussians& more);
/// The same Gaussians with coefficients up to a degree that is not lower, the further ones 0.
void raise_degree(Gaussians& gaussians, int degree);

/// Derivatives of a loss with respect to Gaussians, shaped as they are, and to the camera's pose.
/// Zero for Gaussians that no pixel saw.
struct GaussianGradients {
  std::vector<Vec3f> means;
  std::vector<Vec3f> log_scales;
  std::vector<Eigen::Vector4f> rotations;  ///< perpendicular to the quaternion
  std::vector<float> opacities;
  std::vector<float> sh;
  std::vector<Mat3f> deformation_gradients;  ///< empty where the Gaussians' are
  /// With respect to (ω, τ) of x_camera' = exp([ω]×) x_camera + τ at zero: rotation about the
  /// camera's centre [1/rad], then translation [1/m], in camera axes.
  std::array<double, 6> pose{};
};

}  // namespace matterfit::splat
