// SPDX-License-Identifier: GPL-3.0-or-later
// A force field around a place of the world: an acceleration a (1 − q²)³, q = |x − c|/r < 1.
#include "effects/fade.hpp"
#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kCenter = 0, kRadius = 3, kAcceleration = 4 };

class ForceField final : public Term {
 public:
  explicit ForceField(const Effect& effect) : effect_(effect) {}

  [[nodiscard]] Vec3d force(const MaterialPoint& point, const Moment& moment) const override {
    return point.mass * fade_at(point, moment.time).share() *
           effect_.vector_at(kAcceleration, moment.time);
  }
  void force_adjoint(const MaterialPoint& point, const Moment& moment, const Vec3d& force_bar,
                     MaterialPointBar& bar, double* values) const override {
    const Fade fade = fade_at(point, moment.time);
    const double along = force_bar.dot(effect_.vector_at(kAcceleration, moment.time));
    bar.mass += fade.share() * along;
    const Fade::Bar place = fade.adjoint(point.mass * along);
    bar.position += place.away;
    values[kRadius] += place.radius;
    add_vector(-place.away, values + kCenter);
    add_vector(point.mass * fade.share() * force_bar, values + kAcceleration);
  }
  [[nodiscard]] double acceleration_bound(double /*speed*/) const override {
    return effect_.largest_vector(kAcceleration);
  }

 private:
  [[nodiscard]] Fade fade_at(const MaterialPoint& point, double time) const {
    return {point.position - effect_.vector_at(kCenter, time), effect_.at(kRadius, time)};
  }

  const Effect& effect_;
};

}  // namespace

const EffectType& force_field() {
  static const EffectType row = {
      .name = "force_field",
      .group = Group::kOutside,
      .scope = Scope::kShared,
      .parameters = {{.key = "center",
                      .unit = "m",
                      .size = 3,
                      .standard = {0.0, 0.0, 0.0},
                      .neutral = std::nullopt,
                      .low = -1e6,
                      .high = 1e6,
                      .scale = 0.1,
                      .may_be_keyed = true,
                      .label = "Centre",
                      .sentence = "Where it is strongest, in the world"},
                     {.key = "radius",
                      .unit = "m",
                      .standard = {1.0},
                      .neutral = std::nullopt,
                      .low = 1e-4,
                      .high = 1e6,
                      .scale = 0.5,
                      .coordinate = Coordinate::kLog,
                      .may_be_keyed = true,
                      .label = "Radius",
                      .sentence = "Where it has faded away"},
                     {.key = "acceleration",
                      .unit = "m/s²",
                      .size = 3,
                      .standard = {0.0, 0.0, 0.0},
                      .neutral = 0.0,
                      .low = -1e5,
                      .high = 1e5,
                      .scale = 1.0,
                      .may_be_keyed = true,
                      .label = "Acceleration",
                      .sentence = "What it does to a free body at its centre"}},
      .quantities = {},
      .signature = "The measured body is pushed one way wherever it passes a certain place.",
      .confused_with = {"wind", "hidden_collider", "gravity_direction"},
      .sentence =
          "A force that acts around one place: a draught, a magnet, a thread that nobody "
          "modelled.",
      .make = [](const Effect& effect, const BodyFacts& /*body*/) -> std::unique_ptr<Term> {
        return std::make_unique<ForceField>(effect);
      }};
  return row;
}

}  // namespace matterfit::effects
