// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <span>

#include "base/vec.hpp"
#include "splat/gaussians.hpp"

namespace matterfit::capture {

using splat::kMaxShDegree;
/// Coefficients of real spherical harmonics up to that degree.
inline constexpr int kMaxShBands = 16;
/// The harmonic of degree 0: a colour is ½ + this times its coefficient.
inline constexpr float kShBand0 = 0.28209479F;

/// Values of the 16 real spherical harmonics at a unit direction, in the order and with the signs
/// of 3D Gaussian Splatting (Kerbl et al. 2023, sh_utils: Y₁ = −C₁y, C₁z, −C₁x, …).
[[nodiscard]] std::array<double, kMaxShBands> sh_basis(const Vec3d& direction);

/// Turns functions on the sphere given by their coefficients: c' of f'(d) = f(Rᵀ d). Exact, since
/// each degree is closed under rotation: its matrix is found by projection, D = B⁺(d_k) B(Rᵀ d_k)
/// over 16 directions d_k, with B⁺ computed once.
class ShRotation {
 public:
  explicit ShRotation(const Mat3d& rotation);

  /// In place; `coefficients` are (degree + 1)² × 3, coefficient-major ([k][rgb]).
  void apply(std::span<float> coefficients, int degree) const;
  /// The transpose of turning by one more rotation dR = [ω]× R: ω̄ of what has the cotangents `bar`
  /// in `turned`, the coefficients that apply() left.
  [[nodiscard]] static Vec3d spin_bar(std::span<const float> turned, std::span<const float> bar,
                                      int degree);

 private:
  // Degree l: (2l + 1)², row-major, at the start.
  std::array<std::array<double, 49>, kMaxShDegree> matrices_{};
};

}  // namespace matterfit::capture
