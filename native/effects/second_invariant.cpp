// SPDX-License-Identifier: GPL-3.0-or-later
// A material that feels the second invariant of its stretch: τ = G dev(Ī₁ b̄ − b̄²), what Mooney
// (J. Appl. Phys. 1940) adds to the neo-Hookean law with an energy ½ G (Ī₂ − 3),
// b̄ = J^(−⅔) F Fᵀ, Ī₁ = tr b̄.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

class SecondInvariant final : public Term {
 public:
  explicit SecondInvariant(const Effect& effect) : effect_(effect) {}

  [[nodiscard]] bool has_stress() const override { return true; }
  [[nodiscard]] Mat3d stress(const MaterialPoint& point, const Moment& /*moment*/) const override {
    const Mat3d b = isochoric(point.deformation_gradient);
    return effect_.values[0] * deviator(b.trace() * b - b * b);
  }
  void stress_adjoint(const MaterialPoint& point, const Moment& /*moment*/, const Mat3d& stress_bar,
                      MaterialPointBar& bar, double* values) const override {
    const Mat3d& f = point.deformation_gradient;
    const Mat3d b = isochoric(f);
    const Mat3d s = deviator(0.5 * (stress_bar + stress_bar.transpose()));
    values[0] += (s.array() * (b.trace() * b - b * b).array()).sum();
    const Mat3d b_bar = effect_.values[0] * ((s.array() * b.array()).sum() * Mat3d::Identity() +
                                             b.trace() * s - s * b - b * s);
    // b̄ = J^(−⅔) F Fᵀ.
    const double along = (b_bar.array() * b.array()).sum();
    bar.deformation_gradient += 2.0 * std::pow(f.determinant(), -2.0 / 3.0) * b_bar * f -
                                2.0 / 3.0 * along * f.inverse().transpose();
  }
  /// Up to a stretch of two along two axes: across them ∂²(½ Ī₂)/∂ε² = 2 · 16 · (⅔)² is 14.2.
  [[nodiscard]] double modulus_bound() const override {
    return 16.0 * std::max(0.0, effect_.values[0]);
  }

 private:
  static Mat3d isochoric(const Mat3d& f) {
    return std::pow(f.determinant(), -2.0 / 3.0) * f * f.transpose();
  }
  static Mat3d deviator(const Mat3d& a) { return a - a.trace() / 3.0 * Mat3d::Identity(); }

  const Effect& effect_;
};

}  // namespace

const EffectType& second_invariant() {
  static const EffectType row = {
      .name = "second_invariant",
      .group = Group::kMaterial,
      .scope = Scope::kBody,
      .parameters = {{.key = "modulus",
                      .unit = "Pa",
                      .standard = {0.0},
                      .neutral = 0.0,
                      .low = -1e12,
                      .high = 1e12,
                      .scale = 1e3,
                      .label = "Mooney Modulus",
                      .sentence = "What is added to the shear modulus at rest by the second "
                                  "invariant of the stretch"}},
      .quantities = {},
      .signature = "Pulled along two axes the body is stiffer than pulling it along one says.",
      .confused_with = {"strain_stiffening", "fibres"},
      .sentence =
          "The material feels its second invariant, as rubbers do: pulled along one axis it "
          "softens at moderate stretches.",
      .make = [](const Effect& effect, const BodyFacts& /*body*/) -> std::unique_ptr<Term> {
        return std::make_unique<SecondInvariant>(effect);
      }};
  return row;
}

}  // namespace matterfit::effects
