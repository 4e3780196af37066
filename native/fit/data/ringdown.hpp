// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <span>

#include "base/vec.hpp"

namespace matterfit::fit {

/// How something that was held and let go settles. Fitted to the position s(τ), τ = t − release,
/// along the direction of largest motion, against its mean before release:
///
///   s(τ) = c₀ + c₁ e^(−τ/T) + e^(−στ) (a cos ωτ + b sin ωτ)
///
/// a damped sinusoid on a slow drift whose time T lies between one period and the record's length.
struct Ringdown {
  double drop_m = 0.0;         ///< the drift at the record's end: the settled offset, or the centre
                               ///< line of what still rings [m], not negative
  double frequency_hz = 0.0;   ///< ω / 2π, of the damped motion
  double damping_ratio = 0.0;  ///< σ / √(σ² + ω²); negative where the motion grows
  double amplitude_m = 0.0;    ///< √(a² + b²), at release
  double drift_m = 0.0;        ///< c₁: how much of the offset comes slowly
  double drift_time_s = 0.0;   ///< T
  double residual_m = 0.0;     ///< root mean square of what the fit leaves
  Vec3d direction = Vec3d::Zero();  ///< unit, along the drop
};

/// Levenberg–Marquardt from the best point of a scan over frequency, damping and drift time with
/// the linear coefficients solved for (variable projection). `times` [s] ascending, one position a
/// time [m]; positions that are not finite are left out. Quiet are the samples with t ≤ `release`;
/// without one the first sample after it stands for them. Nothing is returned where nothing rings:
/// fewer than 16 samples or two periods after release, damping beyond a half, or a sinusoid that
/// explains less than half of the motion's variance about the drift. Throws Error(kInput) if the
/// lengths differ.
[[nodiscard]] std::optional<Ringdown> fit_ringdown(std::span<const double> times,
                                                   std::span<const Vec3d> positions,
                                                   double release);

}  // namespace matterfit::fit
