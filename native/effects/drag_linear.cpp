// SPDX-License-Identifier: GPL-3.0-or-later
// Linear drag: f = −m k v, the same deceleration for every part of a body.
#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kRate };

class LinearDrag final : public Term {
 public:
  explicit LinearDrag(const Effect& effect) : effect_(effect) {}

  [[nodiscard]] Vec3d force(const MaterialPoint& point, const Moment& moment) const override {
    return -(effect_.at(kRate, moment.time) * point.mass) * point.velocity;
  }
  void force_adjoint(const MaterialPoint& point, const Moment& moment, const Vec3d& force_bar,
                     MaterialPointBar& bar, double* values) const override {
    const double rate = effect_.at(kRate, moment.time);
    const double along = force_bar.dot(point.velocity);
    values[kRate] -= point.mass * along;
    bar.mass -= rate * along;
    bar.velocity -= rate * point.mass * force_bar;
  }
  [[nodiscard]] double acceleration_bound(double speed) const override {
    return effect_.largest(kRate) * speed;
  }
  [[nodiscard]] double rate_bound(double /*speed*/) const override {
    return effect_.largest(kRate);
  }

 private:
  const Effect& effect_;
};

}  // namespace

const EffectType& drag_linear() {
  static const EffectType row = {
      .name = "drag_linear",
      .group = Group::kOutside,
      .scope = Scope::kShared,
      .parameters = {{.key = "rate",
                      .unit = "1/s",
                      .standard = {0.5},
                      .neutral = 0.0,
                      .low = 0.0,
                      .high = 1e3,
                      .scale = 0.1,
                      .may_be_keyed = true,
                      .label = "Rate",
                      .sentence = "Share of its speed that a free body loses in a second"}},
      .quantities = {},
      .signature = "The measured body slows down in proportion to its speed, in every direction.",
      .confused_with = {"drag_quadratic", "damping_shear", "friction", "gravity_size"},
      .sentence =
          "Something around the body takes speed from it, slow or fast in proportion: a "
          "thick medium, or losses in what it hangs from.",
      .make = [](const Effect& effect, const BodyFacts& /*body*/) -> std::unique_ptr<Term> {
        return std::make_unique<LinearDrag>(effect);
      }};
  return row;
}

}  // namespace matterfit::effects
