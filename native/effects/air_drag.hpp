// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "effects/effect.hpp"
#include "effects/effect_type.hpp"
#include "effects/term.hpp"

namespace matterfit::effects {

/// Drag at high Reynolds numbers, F = −½ ρ c_d A |u| u with u the body's velocity in the medium,
/// spread over the body by volume: each share takes F·V_p/V with its own u. So c_d is that of the
/// whole body (a ball's .5 is .47 … .5 between Reynolds numbers of 1e3 and 2e5), a body in free
/// flight is not deformed by it, and a beam that swings is braked where it is fast. What it leaves
/// out is where on the skin the air pushes. Below kCalm [m/s] the law becomes linear,
/// |u| → √(u² + kCalm²): wind on a body at rest then has a derivative at 0.
inline constexpr double kCalm = 0.01;

/// The numbers of an effect that say how strong it is, one after another from `first`.
struct AirDrag {
  /// c_d, A [m²] (0: the cross-section of a ball of the body's volume, π (3V/4π)^⅔) and ρ [kg/m³].
  enum Value : std::size_t { kCoefficient, kArea, kDensity, kValues };

  const Effect* effect = nullptr;
  std::size_t first = 0;
  double volume = 0.0;     ///< of the body [m³]
  double ball_area = 0.0;  ///< [m²]
  double body_mass = 0.0;  ///< [kg]

  AirDrag(const Effect& of, std::size_t first_value, const BodyFacts& body);

  [[nodiscard]] double area() const;
  /// ½ ρ c_d A V_p/V of a share of the body at `time` [kg/m].
  [[nodiscard]] double factor(const MaterialPoint& point, double time) const;
  /// Adds the cotangent of factor() to the effect's values.
  void factor_adjoint(const MaterialPoint& point, double time, double factor_bar,
                      double* values) const;
  /// The largest acceleration [m/s²] of the body at a speed [m/s] in the medium.
  [[nodiscard]] double acceleration_bound(double speed) const;
  /// |∂a/∂u| there [1/s].
  [[nodiscard]] double rate_bound(double speed) const;
};

/// −factor √(u² + kCalm²) u.
[[nodiscard]] Vec3d air_drag_force(double factor, const Vec3d& u);
/// From the force's cotangent to those of the factor, which it returns, and of u, added to `u_bar`.
double air_drag_adjoint(double factor, const Vec3d& u, const Vec3d& force_bar, Vec3d& u_bar);

/// The three parameters.
[[nodiscard]] std::vector<EffectParameter> air_drag_parameters();

}  // namespace matterfit::effects
