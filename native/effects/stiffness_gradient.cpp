// SPDX-License-Identifier: GPL-3.0-or-later
// A stiffness that grows along the body: extra_stress() of the modulus g·(X − c), X at rest.
#include <algorithm>

#include "effects/extra_stiffness.hpp"
#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kCenter = 0, kSlope = 3, kNu = 6 };

class StiffnessGradient final : public Term {
 public:
  StiffnessGradient(const Effect& effect, const BodyFacts& body) : effect_(effect), body_(body) {}

  [[nodiscard]] bool has_stress() const override { return true; }
  [[nodiscard]] Mat3d stress(const MaterialPoint& point, const Moment& /*moment*/) const override {
    return extra_stress(slope().dot(away(point)), effect_.values[kNu], point.deformation_gradient);
  }
  void stress_adjoint(const MaterialPoint& point, const Moment& /*moment*/, const Mat3d& stress_bar,
                      MaterialPointBar& bar, double* values) const override {
    const ExtraStressBar own = extra_stress_adjoint(slope().dot(away(point)), effect_.values[kNu],
                                                    point.deformation_gradient, stress_bar);
    bar.deformation_gradient += own.f;
    values[kNu] += own.nu;
    const Vec3d away_bar = own.modulus * slope();
    bar.rest += away_bar;
    add_vector(own.modulus * away(point), values + kSlope);
    add_vector(-away_bar, values + kCenter);
  }
  [[nodiscard]] double modulus_bound() const override {
    const double at_center = slope().dot(body_.center - effect_.vector_at(kCenter, 0.0));
    return std::max(0.0, at_center + slope().norm() * body_.radius) *
           wave_modulus_ratio(effect_.values[kNu]);
  }

 private:
  [[nodiscard]] Vec3d slope() const { return effect_.vector_at(kSlope, 0.0); }
  [[nodiscard]] Vec3d away(const MaterialPoint& point) const {
    return point.rest - effect_.vector_at(kCenter, 0.0);
  }

  const Effect& effect_;
  BodyFacts body_;
};

}  // namespace

const EffectType& stiffness_gradient() {
  static const EffectType row = {
      .name = "stiffness_gradient",
      .group = Group::kMaterial,
      .scope = Scope::kBody,
      .parameters = {{.key = "center",
                      .unit = "m",
                      .size = 3,
                      .standard = {0.0, 0.0, 0.0},
                      .neutral = std::nullopt,
                      .low = -1e6,
                      .high = 1e6,
                      .scale = 0.1,
                      .label = "Centre",
                      .sentence = "Where the body has its own stiffness, at rest, in the world"},
                     {.key = "slope",
                      .unit = "Pa/m",
                      .size = 3,
                      .standard = {0.0, 0.0, 0.0},
                      .neutral = 0.0,
                      .low = -1e13,
                      .high = 1e13,
                      .scale = 1e5,
                      .label = "Slope",
                      .sentence =
                          "How Young's modulus grows along each axis of the world, at rest"},
                     {.key = "nu",
                      .unit = "",
                      .standard = {0.3},
                      .neutral = std::nullopt,
                      .low = 0.0,
                      .high = 0.49,
                      .scale = 0.1,
                      .label = "Poisson's ratio",
                      .sentence = "Of the added stiffness"}},
      .quantities = {},
      .signature = "One end of the body gives way more than simulated, the other less.",
      .confused_with = {"density_gradient", "stiffness_inclusion", "attached_mass", "relaxation"},
      .sentence = "The body is stiffer at one end: it has cured, dried or aged unevenly.",
      .make = [](const Effect& effect, const BodyFacts& body) -> std::unique_ptr<Term> {
        return std::make_unique<StiffnessGradient>(effect, body);
      }};
  return row;
}

}  // namespace matterfit::effects
