// SPDX-License-Identifier: GPL-3.0-or-later
// Fibres along one direction: ψ = ⅛ E_f (I₄ − 1)², I₄ = |F a₀|², so that
// τ = ½ E_f (I₄ − 1) a ⊗ a, a = F a₀ (the standard reinforcing model: Qiu and Pence, J. Elasticity
// 1997). E_f adds to Young's modulus along the fibres at small strains.
#include <algorithm>

#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kDirection = 0, kModulus = 3 };

class Fibres final : public Term {
 public:
  explicit Fibres(const Effect& effect) : effect_(effect) {
    const Vec3d direction = effect.vector_at(kDirection, 0.0);
    length_ = std::max(direction.norm(), 1e-12);
    along_ = direction / length_;
  }

  [[nodiscard]] bool has_stress() const override { return true; }
  [[nodiscard]] Mat3d stress(const MaterialPoint& point, const Moment& /*moment*/) const override {
    const Vec3d a = point.deformation_gradient * along_;
    return 0.5 * effect_.values[kModulus] * (a.squaredNorm() - 1.0) * a * a.transpose();
  }
  void stress_adjoint(const MaterialPoint& point, const Moment& /*moment*/, const Mat3d& stress_bar,
                      MaterialPointBar& bar, double* values) const override {
    const Vec3d a = point.deformation_gradient * along_;
    const double half = 0.5 * effect_.values[kModulus];
    const double stretch = a.squaredNorm() - 1.0;
    const double work = a.dot(stress_bar * a);
    values[kModulus] += 0.5 * stretch * work;
    const Vec3d a_bar =
        half * (2.0 * work * a + stretch * ((stress_bar + stress_bar.transpose()) * a));
    bar.deformation_gradient += a_bar * along_.transpose();
    const Vec3d along_bar = point.deformation_gradient.transpose() * a_bar;
    add_vector((along_bar - along_.dot(along_bar) * along_) / length_, values + kDirection);
  }
  [[nodiscard]] double modulus_bound() const override {
    return std::max(0.0, effect_.values[kModulus]);
  }

 private:
  const Effect& effect_;
  Vec3d along_;
  double length_;
};

}  // namespace

const EffectType& fibres() {
  static const EffectType row = {
      .name = "fibres",
      .group = Group::kMaterial,
      .scope = Scope::kBody,
      .parameters = {{.key = "direction",
                      .unit = "",
                      .size = 3,
                      .standard = {0.0, 0.0, 1.0},
                      .neutral = std::nullopt,
                      .low = -1e6,
                      .high = 1e6,
                      .scale = 0.1,
                      .label = "Direction",
                      .sentence = "Along the fibres in the body at rest, in the world"},
                     {.key = "modulus",
                      .unit = "Pa",
                      .standard = {0.0},
                      .neutral = 0.0,
                      .low = -1e12,
                      .high = 1e12,
                      .scale = 1e4,
                      .label = "Fibre stiffness",
                      .sentence = "What they add to Young's modulus along them"}},
      .quantities = {},
      .signature = "The body is stiffer along one of its own directions than across it.",
      .confused_with = {"stiffness_gradient", "stiffness_inclusion", "volumetric_split"},
      .sentence = "The material has a grain: fibres, print lines, a rolled sheet.",
      .make = [](const Effect& effect, const BodyFacts& /*body*/) -> std::unique_ptr<Term> {
        return std::make_unique<Fibres>(effect);
      }};
  return row;
}

}  // namespace matterfit::effects
