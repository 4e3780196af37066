// SPDX-License-Identifier: GPL-3.0-or-later
// An accelerated frame: everything is seen from something that moves with the acceleration
// a cos(2π f t + φ), so f = −m a cos(2π f t + φ).
#include <cmath>
#include <numbers>

#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kAcceleration = 0, kFrequency = 3, kPhase = 4 };

class FrameAcceleration final : public Term {
 public:
  explicit FrameAcceleration(const Effect& effect) : effect_(effect) {}

  [[nodiscard]] Vec3d force(const MaterialPoint& point, const Moment& moment) const override {
    return -(point.mass * std::cos(angle(moment.time))) *
           effect_.vector_at(kAcceleration, moment.time);
  }
  void force_adjoint(const MaterialPoint& point, const Moment& moment, const Vec3d& force_bar,
                     MaterialPointBar& bar, double* values) const override {
    const double cosine = std::cos(angle(moment.time));
    const double along = force_bar.dot(effect_.vector_at(kAcceleration, moment.time));
    bar.mass -= cosine * along;
    add_vector(-(point.mass * cosine) * force_bar, values + kAcceleration);
    const double angle_bar = point.mass * std::sin(angle(moment.time)) * along;
    values[kFrequency] += 2.0 * std::numbers::pi * moment.time * angle_bar;
    values[kPhase] += kRadians * angle_bar;
  }
  [[nodiscard]] double acceleration_bound(double /*speed*/) const override {
    return effect_.largest_vector(kAcceleration);
  }

 private:
  static constexpr double kRadians = std::numbers::pi / 180.0;
  [[nodiscard]] double angle(double time) const {
    return 2.0 * std::numbers::pi * effect_.values[kFrequency] * time +
           kRadians * effect_.values[kPhase];
  }

  const Effect& effect_;
};

}  // namespace

const EffectType& frame_acceleration() {
  static const EffectType row = {
      .name = "frame_acceleration",
      .group = Group::kOutside,
      .scope = Scope::kShared,
      .parameters = {{.key = "acceleration",
                      .unit = "m/s²",
                      .size = 3,
                      .standard = {0.0, 0.0, 0.0},
                      .neutral = 0.0,
                      .low = -1e5,
                      .high = 1e5,
                      .scale = 1.0,
                      .may_be_keyed = true,
                      .label = "Acceleration",
                      .sentence = "The largest of the table, the lorry or the camera"},
                     {.key = "frequency",
                      .unit = "Hz",
                      .standard = {0.0},
                      .neutral = std::nullopt,
                      .low = 0.0,
                      .high = 1e5,
                      .scale = 1.0,
                      .label = "Frequency",
                      .sentence = "How often it shakes; 0: a steady acceleration"},
                     {.key = "phase",
                      .unit = "degrees",
                      .standard = {0.0},
                      .neutral = std::nullopt,
                      .low = -360.0,
                      .high = 360.0,
                      .scale = 30.0,
                      .label = "Phase",
                      .sentence = "Where in a period the first frame lies; -90 starts from none"}},
      .quantities = {},
      .signature = "Every part of every body moves to and fro together, also in free flight.",
      .confused_with = {"gravity_direction", "gravity_size", "camera_drift", "wind"},
      .sentence = "What the body stands in is itself accelerated or shaken.",
      .make = [](const Effect& effect, const BodyFacts& /*body*/) -> std::unique_ptr<Term> {
        return std::make_unique<FrameAcceleration>(effect);
      }};
  return row;
}

}  // namespace matterfit::effects
