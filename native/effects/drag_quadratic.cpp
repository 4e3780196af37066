// SPDX-License-Identifier: GPL-3.0-or-later
// Quadratic drag in a medium at rest: AirDrag with u = v.
#include "effects/air_drag.hpp"
#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

class QuadraticDrag final : public Term {
 public:
  QuadraticDrag(const Effect& effect, const BodyFacts& body) : drag_(effect, 0, body) {}

  [[nodiscard]] Vec3d force(const MaterialPoint& point, const Moment& moment) const override {
    return air_drag_force(drag_.factor(point, moment.time), point.velocity);
  }
  void force_adjoint(const MaterialPoint& point, const Moment& moment, const Vec3d& force_bar,
                     MaterialPointBar& bar, double* values) const override {
    const double factor_bar =
        air_drag_adjoint(drag_.factor(point, moment.time), point.velocity, force_bar, bar.velocity);
    drag_.factor_adjoint(point, moment.time, factor_bar, values);
  }
  [[nodiscard]] double acceleration_bound(double speed) const override {
    return drag_.acceleration_bound(speed);
  }
  [[nodiscard]] double rate_bound(double speed) const override { return drag_.rate_bound(speed); }

 private:
  AirDrag drag_;
};

}  // namespace

const EffectType& drag_quadratic() {
  static const EffectType row = {
      .name = "drag_quadratic",
      .group = Group::kOutside,
      .scope = Scope::kShared,
      .parameters = air_drag_parameters(),
      .quantities = {},
      .signature = "The measured body falls behind where it is fast, with the square of its speed.",
      .confused_with = {"drag_linear", "gravity_size", "scale", "frame_rate", "damping_shear"},
      .sentence = "The air brakes the body: twice the speed, four times the force.",
      .make = [](const Effect& effect, const BodyFacts& body) -> std::unique_ptr<Term> {
        return std::make_unique<QuadraticDrag>(effect, body);
      }};
  return row;
}

}  // namespace matterfit::effects
