// SPDX-License-Identifier: GPL-3.0-or-later
// Buoyancy in a medium of density ρ_m: f = −ρ_m V g, and the medium that moves along with the body,
// c_m ρ_m V (a ball drags along half its volume, c_m = ½; Lamb, Hydrodynamics, §92). That share is
// inertia without weight: the solver adds it to the body's density, and its weight is taken off.
#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kDensity, kAddedMass };

class Buoyancy final : public Term {
 public:
  Buoyancy(const Effect& effect, const BodyFacts& body) : effect_(effect), body_(body) {}

  [[nodiscard]] Vec3d force(const MaterialPoint& point, const Moment& moment) const override {
    return -(lifted() * point.volume) * moment.gravity;
  }
  void force_adjoint(const MaterialPoint& point, const Moment& moment, const Vec3d& force_bar,
                     MaterialPointBar& bar, double* values) const override {
    const double lifted_bar = -point.volume * force_bar.dot(moment.gravity);
    values[kDensity] += (1.0 + effect_.values[kAddedMass]) * lifted_bar;
    values[kAddedMass] += effect_.values[kDensity] * lifted_bar;
    bar.gravity -= lifted() * point.volume * force_bar;
  }
  [[nodiscard]] double acceleration_bound(double /*speed*/) const override {
    return lifted() / body_.density * body_.gravity;
  }

 private:
  /// Displaced and carried along [kg/m³].
  [[nodiscard]] double lifted() const {
    return (1.0 + effect_.values[kAddedMass]) * effect_.values[kDensity];
  }

  const Effect& effect_;
  BodyFacts body_;
};

}  // namespace

const EffectType& buoyancy() {
  static const EffectType row = {
      .name = "buoyancy",
      .group = Group::kOutside,
      .scope = Scope::kShared,
      .parameters = {{.key = "medium_density",
                      .unit = "kg/m³",
                      .standard = {1.204},
                      .neutral = 0.0,
                      .low = 0.0,
                      .high = 2e4,
                      .scale = 1.0,
                      .label = "Density of the medium",
                      .sentence = "Air at 20 °C has 1.204 kg/m³, water 998"},
                     {.key = "added_mass",
                      .unit = "",
                      .standard = {0.5},
                      .neutral = std::nullopt,
                      .low = 0.0,
                      .high = 10.0,
                      .scale = 0.1,
                      .label = "Added mass",
                      .sentence = "Share of the displaced medium that moves along: a ball has .5"}},
      .quantities = {},
      .signature = "The measured body falls more slowly from the first moment, at any speed.",
      .confused_with = {"gravity_size", "density", "scale", "frame_rate"},
      .sentence =
          "The air or water that the body displaces carries a part of its weight, and has "
          "to be moved aside.",
      .make = [](const Effect& effect, const BodyFacts& body) -> std::unique_ptr<Term> {
        return std::make_unique<Buoyancy>(effect, body);
      },
      .added_density =
          [](const Effect& effect) { return effect.values[kDensity] * effect.values[kAddedMass]; },
      .added_density_adjoint =
          [](const Effect& effect, double density_bar, double* values) {
            values[kDensity] += effect.values[kAddedMass] * density_bar;
            values[kAddedMass] += effect.values[kDensity] * density_bar;
          }};
  return row;
}

}  // namespace matterfit::effects
