// SPDX-License-Identifier: GPL-3.0-or-later
#include "effects/air_drag.hpp"

#include <cmath>
#include <numbers>

namespace matterfit::effects {

AirDrag::AirDrag(const Effect& of, std::size_t first_value, const BodyFacts& body)
    : effect(&of),
      first(first_value),
      volume(body.volume),
      ball_area(std::numbers::pi * std::pow(0.75 * body.volume / std::numbers::pi, 2.0 / 3.0)),
      body_mass(body.density * body.volume) {}

double AirDrag::area() const {
  const double own = effect->values[first + kArea];
  return own > 0.0 ? own : ball_area;
}

double AirDrag::factor(const MaterialPoint& point, double time) const {
  return 0.5 * effect->at(first + kDensity, time) * effect->at(first + kCoefficient, time) *
         area() * point.volume / volume;
}

void AirDrag::factor_adjoint(const MaterialPoint& point, double time, double factor_bar,
                             double* values) const {
  const double share = 0.5 * point.volume / volume * factor_bar;
  const double coefficient = effect->at(first + kCoefficient, time);
  const double density = effect->at(first + kDensity, time);
  values[first + kCoefficient] += share * density * area();
  values[first + kDensity] += share * coefficient * area();
  if (effect->values[first + kArea] > 0.0) values[first + kArea] += share * density * coefficient;
}

double AirDrag::acceleration_bound(double speed) const {
  return 0.5 * effect->largest(first + kDensity) * effect->largest(first + kCoefficient) * area() *
         std::hypot(speed, kCalm) * speed / body_mass;
}

double AirDrag::rate_bound(double speed) const {
  return 0.5 * effect->largest(first + kDensity) * effect->largest(first + kCoefficient) * area() *
         2.0 * std::hypot(speed, kCalm) / body_mass;
}

Vec3d air_drag_force(double factor, const Vec3d& u) {
  return -(factor * std::sqrt(u.squaredNorm() + kCalm * kCalm)) * u;
}

double air_drag_adjoint(double factor, const Vec3d& u, const Vec3d& force_bar, Vec3d& u_bar) {
  const double size = std::sqrt(u.squaredNorm() + kCalm * kCalm);
  const double along = force_bar.dot(u);
  u_bar -= factor * (size * force_bar + along / size * u);
  return -size * along;
}

std::vector<EffectParameter> air_drag_parameters() {
  return {{.key = "drag_coefficient",
           .unit = "",
           .standard = {0.5},
           .neutral = 0.0,
           .low = 0.0,
           .high = 100.0,
           .scale = 0.1,
           .may_be_keyed = true,
           .label = "Drag coefficient",
           .sentence = "c_d of the whole body, by its area: a ball has .5, a cube 1.05, a flat "
                       "plate across the flow 1.2"},
          {.key = "area",
           .unit = "m²",
           .standard = {0.0},
           .neutral = std::nullopt,
           .low = 0.0,
           .high = 1e6,
           .scale = 0.01,
           .label = "Reference area",
           .sentence = "What the drag coefficient refers to; 0: the cross-section of a ball of the "
                       "body's volume"},
          {.key = "air_density",
           .unit = "kg/m³",
           .standard = {1.204},
           .neutral = 0.0,
           .low = 0.0,
           .high = 2e4,
           .scale = 0.1,
           .may_be_keyed = true,
           .label = "Density of the medium",
           .sentence = "Air at 20 °C has 1.204 kg/m³, water 998"}};
}

}  // namespace matterfit::effects
