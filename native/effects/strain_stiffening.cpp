// SPDX-License-Identifier: GPL-3.0-or-later
// A material that stiffens as it is stretched: τ = G (Ī₁ − 3)ⁿ dev b̄, b̄ = J^(−⅔) F Fᵀ, Ī₁ = tr b̄,
// a power of what Yeoh (Rubber Chem. Technol. 1993) adds to the neo-Hookean law, n = 1 and 2.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kModulus, kExponent };

class StrainStiffening final : public Term {
 public:
  explicit StrainStiffening(const Effect& effect) : effect_(effect) {}

  [[nodiscard]] bool has_stress() const override { return true; }
  [[nodiscard]] Mat3d stress(const MaterialPoint& point, const Moment& /*moment*/) const override {
    const Stretch at(point.deformation_gradient);
    return effect_.values[kModulus] * std::pow(at.more, effect_.values[kExponent]) * at.deviator;
  }
  void stress_adjoint(const MaterialPoint& point, const Moment& /*moment*/, const Mat3d& stress_bar,
                      MaterialPointBar& bar, double* values) const override {
    const Mat3d& f = point.deformation_gradient;
    const Stretch at(f);
    if (!(at.more > 0.0)) return;
    const double modulus = effect_.values[kModulus];
    const double exponent = effect_.values[kExponent];
    const double power = std::pow(at.more, exponent);
    const double work = (stress_bar.array() * at.deviator.array()).sum();
    values[kModulus] += power * work;
    values[kExponent] += modulus * power * std::log(at.more) * work;
    // The derivative by b̄: the deviator is a projection, Ī₁ its trace.
    const Mat3d symmetric = 0.5 * (stress_bar + stress_bar.transpose());
    const Mat3d of_deviator = symmetric - symmetric.trace() / 3.0 * Mat3d::Identity();
    const Mat3d b_bar =
        modulus * (power * of_deviator + exponent * power / at.more * work * Mat3d::Identity());
    // b̄ = J^(−⅔) F Fᵀ.
    const double along = (b_bar.array() * at.b.array()).sum();
    bar.deformation_gradient +=
        2.0 * at.scale * b_bar * f - 2.0 / 3.0 * along * f.inverse().transpose();
  }
  /// Up to a stretch of two, where Ī₁ is 5.
  [[nodiscard]] double modulus_bound() const override {
    constexpr double kMore = 2.0;
    const double exponent = effect_.values[kExponent];
    return std::max(0.0, effect_.values[kModulus]) * std::pow(kMore, exponent) *
           (1.0 + 2.0 * exponent) * 4.0;
  }

 private:
  struct Stretch {
    double scale;  ///< J^(−⅔)
    Mat3d b;
    double more;  ///< Ī₁ − 3
    Mat3d deviator;
    explicit Stretch(const Mat3d& f)
        : scale(std::pow(f.determinant(), -2.0 / 3.0)),
          b(scale * f * f.transpose()),
          more(std::max(0.0, b.trace() - 3.0)),
          deviator(b - b.trace() / 3.0 * Mat3d::Identity()) {}
  };

  const Effect& effect_;
};

}  // namespace

const EffectType& strain_stiffening() {
  static const EffectType row = {
      .name = "strain_stiffening",
      .group = Group::kMaterial,
      .scope = Scope::kBody,
      .parameters = {{.key = "modulus",
                      .unit = "Pa",
                      .standard = {0.0},
                      .neutral = 0.0,
                      .low = -1e12,
                      .high = 1e12,
                      .scale = 1e3,
                      .label = "Stiffening",
                      .sentence = "What is added to the shear modulus where the first invariant is "
                                  "4 in place of 3"},
                     {.key = "exponent",
                      .unit = "",
                      .standard = {1.0},
                      .neutral = std::nullopt,
                      .low = 0.5,
                      .high = 6.0,
                      .scale = 0.5,
                      .label = "Exponent",
                      .sentence = "How suddenly it sets in"}},
      .quantities = {},
      .signature = "Large stretches fall short of what is simulated while small ones agree.",
      .confused_with = {"fibres", "relaxation", "yield", "damping_shear"},
      .sentence = "The material becomes stiffer the farther it is stretched, as rubber does.",
      .make = [](const Effect& effect, const BodyFacts& /*body*/) -> std::unique_ptr<Term> {
        return std::make_unique<StrainStiffening>(effect);
      }};
  return row;
}

}  // namespace matterfit::effects
