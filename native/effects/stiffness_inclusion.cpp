// SPDX-License-Identifier: GPL-3.0-or-later
// A stiffer or softer place: extra_stress() of a modulus that fades as (1 − q²)³ with the distance
// at rest from a place, q = |X − c|/r < 1.
#include <algorithm>

#include "effects/extra_stiffness.hpp"
#include "effects/fade.hpp"
#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kCenter = 0, kRadius = 3, kModulus = 4, kNu = 5 };

class StiffnessInclusion final : public Term {
 public:
  explicit StiffnessInclusion(const Effect& effect) : effect_(effect) {}

  [[nodiscard]] bool has_stress() const override { return true; }
  [[nodiscard]] Mat3d stress(const MaterialPoint& point, const Moment& /*moment*/) const override {
    const Fade fade = fade_at(point);
    if (!(fade.left > 0.0)) return Mat3d::Zero();
    return extra_stress(fade.share() * effect_.values[kModulus], effect_.values[kNu],
                        point.deformation_gradient);
  }
  void stress_adjoint(const MaterialPoint& point, const Moment& /*moment*/, const Mat3d& stress_bar,
                      MaterialPointBar& bar, double* values) const override {
    const Fade fade = fade_at(point);
    if (!(fade.left > 0.0)) return;
    const double modulus = effect_.values[kModulus];
    const ExtraStressBar own = extra_stress_adjoint(fade.share() * modulus, effect_.values[kNu],
                                                    point.deformation_gradient, stress_bar);
    bar.deformation_gradient += own.f;
    values[kNu] += own.nu;
    values[kModulus] += fade.share() * own.modulus;
    const Fade::Bar place = fade.adjoint(modulus * own.modulus);
    values[kRadius] += place.radius;
    bar.rest += place.away;
    add_vector(-place.away, values + kCenter);
  }
  [[nodiscard]] double modulus_bound() const override {
    return std::max(0.0, effect_.values[kModulus]) * wave_modulus_ratio(effect_.values[kNu]);
  }

 private:
  [[nodiscard]] Fade fade_at(const MaterialPoint& point) const {
    return {point.rest - effect_.vector_at(kCenter, 0.0), effect_.values[kRadius]};
  }

  const Effect& effect_;
};

}  // namespace

const EffectType& stiffness_inclusion() {
  static const EffectType row = {
      .name = "stiffness_inclusion",
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
                      .sentence = "Where it is in the body at rest, in the world"},
                     {.key = "radius",
                      .unit = "m",
                      .standard = {0.1},
                      .neutral = std::nullopt,
                      .low = 1e-4,
                      .high = 1e6,
                      .scale = 0.5,
                      .coordinate = Coordinate::kLog,
                      .label = "Radius",
                      .sentence = "Where it has faded away"},
                     {.key = "modulus",
                      .unit = "Pa",
                      .standard = {0.0},
                      .neutral = 0.0,
                      .low = -1e12,
                      .high = 1e12,
                      .scale = 1e4,
                      .label = "Added stiffness",
                      .sentence = "Young's modulus that is added at its centre; below 0 it is "
                                  "softer there"},
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
      .signature = "One region of the body bends or shears less, or more, than simulated.",
      .confused_with = {"stiffness_gradient", "density_inclusion", "pre_strain", "attached_mass"},
      .sentence = "There is something stiffer or softer inside: a core, a bubble, a glued seam.",
      .make = [](const Effect& effect, const BodyFacts& /*body*/) -> std::unique_ptr<Term> {
        return std::make_unique<StiffnessInclusion>(effect);
      }};
  return row;
}

}  // namespace matterfit::effects
