// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "base/vec.hpp"
#include "material/classical/law_gradient.hpp"
#include "material/material.hpp"

/// What is learned of a material beside its law (Material::correction).
namespace matterfit::material {

/// An isotropic energy beside that of a body's law, of the Hencky strain H = ½ ln F Fᵀ: with
/// s = |dev H|², t = tr H, k = tr (dev H)³, φ_a(x) = x²/(x + a²), and μ and K the law's own shear
/// and bulk modulus at rest,
///   W = μ (c₀ φ_.15(s) + c₁ φ_.4(s) + c₂ φ_1(s) + c₃ k/√(s + .4²)) + ½ K c₄ φ_.15(t²),
/// so that τ = ∂W/∂H (the Kirchhoff stress and the Hencky strain of an isotropic material are work
/// conjugate; Hill, Adv. Appl. Mech. 18, 1978). Beside the quadratic energy μ s + ½ K t² each
/// number is the share that the shear or bulk modulus gains beyond a strain of about a. No term has
/// a stress or a stiffness at rest, where E and ν stay what they are, and none grows faster than
/// H². In the fluid the shape's terms do nothing.
class Correction {
 public:
  explicit Correction(const Material& material);

  /// The material has none, or all numbers are 0: then it is not called.
  [[nodiscard]] bool neutral() const;
  /// W(F) [J/m³ at rest].
  [[nodiscard]] double energy(const Mat3d& f) const;
  /// Kirchhoff stress [Pa]; finite for any finite F.
  [[nodiscard]] Mat3d stress(const Mat3d& f) const;
  /// The adjoint of stress(): adds to the cotangents of F and of the numbers (kCorrectionSize).
  void stress_adjoint(const Mat3d& f, const Mat3d& stress_bar, Mat3d& f_bar, double* numbers) const;
  /// What it adds to the law's modulus λ + 2μ at most [Pa], down to a compression of .7.
  [[nodiscard]] double modulus_bound() const;

 private:
  double shear_ = 0.0;  ///< [Pa]
  double bulk_ = 0.0;   ///< [Pa]
  std::array<double, kCorrectionSize> numbers_{};
};

/// Adds what the derivatives `numbers` of a run by the stress's numbers say of the material: by the
/// numbers themselves, and by E, ν (of the latent law by its code) or the bulk modulus, whose
/// multiples they are.
void add_correction_gradient(const Material& material, std::span<const double> numbers,
                             MaterialGradient& gradient);

/// Throws Error(kInput), beginning with `where`, for numbers that are not as many, not finite, out
/// of bounds, or that together would take more than nine tenths of a stiffness of the quadratic
/// energy at some strain.
void check_correction(std::span<const double> numbers, const std::string& where);

}  // namespace matterfit::material
