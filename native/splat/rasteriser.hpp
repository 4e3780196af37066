// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "base/parallel.hpp"
#include "math/simd_target.hpp"
#include "splat/camera.hpp"
#include "splat/gaussians.hpp"

namespace matterfit::splat {

/// The image formation, here and nowhere else. Gaussians in front of the near plane, sorted by
/// depth t_z rounded to float (ties by index), are blended front to back (Kerbl et al. 2023;
/// Zwicker et al. 2001 for the projection):
///   Σ₂ = J W Σ' Wᵀ Jᵀ + blur I,  J the Jacobian of the pinhole at the mean (below),
///   α = min(0.99, σ exp(−½ dᵀ Σ₂⁻¹ d)),  d = pixel centre − projected mean,
///   colour = Σ T α c,  mask = Σ T α,  depth = Σ T α t_z,  T = Π (1 − α) over those in front.
/// - A pair with α < 1/255 contributes nothing; there is no other limit to a Gaussian's extent.
/// - A pixel takes Gaussians as long as T ≥ 1e-4 before them.
/// - In J the directions t_x/t_z and t_y/t_z are clamped to the image and 15 % of its size around
///   it (the linearisation fails far outside).
/// - A Gaussian whose Σ₂ overflows, or is singular (without blur), is not drawn; nor is one whose
///   Σ₂ − blur I is singular, where `antialiased`.
/// Colours are those of the data, sRGB for trained scenes, and are blended as they are.
struct RenderOptions {
  double blur = 0.3;  ///< variance added to Σ₂ [pixels²]; 0: none
  /// Opacities are of the Gaussians before the blur, which then keeps their weight in the image:
  /// σ √(det (Σ₂ − blur I) / det Σ₂) for σ (Mip-Splatting, Yu et al. 2024). For scenes trained so.
  bool antialiased = false;
  double near_plane = 0.01;  ///< Gaussians with t_z ≤ this are not drawn [m]
};

inline constexpr double kSmallestAlpha = 1.0 / 255.0;
inline constexpr double kLargestAlpha = 0.99;
inline constexpr double kSmallestTransmittance = 1e-4;
inline constexpr double kClampMargin = 0.15;  ///< of the image's size, in J

/// What a camera sees, or derivatives of a loss with respect to it. Row-major; over black: over a
/// background b it is colour + (1 − mask) b.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<float> colour;  ///< (3, height, width)
  std::vector<float> mask;    ///< (height, width) in [0, 1]
  std::vector<float> depth;   ///< (height, width) [m], not divided by the mask

  Image() = default;
  Image(int image_width, int image_height);  ///< of zeros
  [[nodiscard]] std::size_t pixels() const { return mask.size(); }
};

/// Renders Gaussians and differentiates what it rendered last. Keeps its memory between calls.
/// The results' bits do not depend on the number of threads; between SIMD targets they differ by
/// rounding, and those of gradients between makers of processors, whose reciprocals are approximate
/// in ways of their own. Not for use by two threads at once.
class Rasteriser {
 public:
  /// Throws Error(kInput) if the processor lacks the target.
  explicit Rasteriser(std::shared_ptr<Arena> arena, SimdTarget target = SimdTarget::kAuto);
  ~Rasteriser();
  Rasteriser(const Rasteriser&) = delete;
  Rasteriser& operator=(const Rasteriser&) = delete;

  /// Throws Error(kInput) for arrays of different lengths, a number that is not finite, a zero
  /// quaternion, an opacity outside [0, 1], a camera that is none. No Gaussians give zeros.
  /// The image is valid until the next call.
  const Image& render(const Gaussians& gaussians, const Camera& camera,
                      const RenderOptions& options = {});

  /// Derivatives of a loss through the last image, exactly those of the formula above where it is
  /// smooth. `gaussians` are those of render(), unchanged. `gradients` is overwritten. Throws
  /// Error(kInput) for a loss gradient of another size or one that is not finite.
  void backward(const Gaussians& gaussians, const Image& loss_gradient,
                GaussianGradients& gradients);

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

/// One image.
[[nodiscard]] Image render(const Gaussians& gaussians, const Camera& camera,
                           const RenderOptions& options = {}, int threads = 0);

}  // namespace matterfit::splat
