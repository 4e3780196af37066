// SPDX-License-Identifier: GPL-3.0-or-later
// Wind: what moving air adds to the drag of air at rest, D(v − w) − D(v), D as AirDrag's. Beside a
// drag_quadratic of the same numbers both together are D(v − w); alone it pushes a body at rest as
// the wind does, and brakes nothing.
#include <utility>

#include "effects/air_drag.hpp"
#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kVelocity = 0, kDrag = 3 };

class Wind final : public Term {
 public:
  Wind(const Effect& effect, const BodyFacts& body) : effect_(effect), drag_(effect, kDrag, body) {}

  [[nodiscard]] Vec3d force(const MaterialPoint& point, const Moment& moment) const override {
    const double factor = drag_.factor(point, moment.time);
    return air_drag_force(factor, point.velocity - effect_.vector_at(kVelocity, moment.time)) -
           air_drag_force(factor, point.velocity);
  }
  void force_adjoint(const MaterialPoint& point, const Moment& moment, const Vec3d& force_bar,
                     MaterialPointBar& bar, double* values) const override {
    const double factor = drag_.factor(point, moment.time);
    Vec3d u_bar = Vec3d::Zero();
    const Vec3d u = point.velocity - effect_.vector_at(kVelocity, moment.time);
    const double factor_bar = air_drag_adjoint(factor, u, force_bar, u_bar) +
                              air_drag_adjoint(factor, point.velocity, -force_bar, bar.velocity);
    bar.velocity += u_bar;
    add_vector(-u_bar, values + kVelocity);
    drag_.factor_adjoint(point, moment.time, factor_bar, values);
  }
  [[nodiscard]] double acceleration_bound(double speed) const override {
    return drag_.acceleration_bound(speed + effect_.largest_vector(kVelocity)) +
           drag_.acceleration_bound(speed);
  }
  [[nodiscard]] double rate_bound(double speed) const override {
    return drag_.rate_bound(speed + effect_.largest_vector(kVelocity));
  }

 private:
  const Effect& effect_;
  AirDrag drag_;
};

std::vector<EffectParameter> parameters() {
  std::vector<EffectParameter> all = {{.key = "velocity",
                                       .unit = "m/s",
                                       .size = 3,
                                       .standard = {0.0, 0.0, 0.0},
                                       .neutral = 0.0,
                                       .low = -300.0,
                                       .high = 300.0,
                                       .scale = 1.0,
                                       .may_be_keyed = true,
                                       .label = "Velocity",
                                       .sentence = "Where the air goes, and how fast"}};
  for (EffectParameter& parameter : air_drag_parameters()) all.push_back(std::move(parameter));
  return all;
}

}  // namespace

const EffectType& wind() {
  static const EffectType row = {
      .name = "wind",
      .group = Group::kOutside,
      .scope = Scope::kShared,
      .parameters = parameters(),
      .quantities = {},
      .signature = "The measured body drifts to one side, the more the faster it moves along.",
      .confused_with = {"gravity_direction", "force_field", "frame_acceleration", "camera_drift"},
      .sentence =
          "Moving air carries the body along. The drag of the air itself is the effect "
          "drag_quadratic.",
      .beside = "drag_quadratic",
      .make = [](const Effect& effect, const BodyFacts& body) -> std::unique_ptr<Term> {
        return std::make_unique<Wind>(effect, body);
      }};
  return row;
}

}  // namespace matterfit::effects
