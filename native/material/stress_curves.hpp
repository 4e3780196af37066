// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "material/material.hpp"
#include "material/neural/published_weights.hpp"

/// What a testing machine would measure of a law: stress against stretch.
namespace matterfit::material {

/// Pulled or pressed along x with free sides; along x and y alike with a free z; sheared in x along
/// y, F = 1 + γ eₓ⊗e_y, with all sides held.
enum class Pull { kUniaxial, kEquibiaxial, kShear };
inline constexpr std::array kPulls{Pull::kUniaxial, Pull::kEquibiaxial, Pull::kShear};
/// "uniaxial", "equibiaxial", "shear".
[[nodiscard]] std::string_view pull_name(Pull pull);

struct CurvePoint {
  double by = 1.0;       ///< the stretch λ along x; of shear γ
  double nominal = 0.0;  ///< force on the area at rest [Pa]: P_xx, of shear P_xy
  double cauchy = 0.0;   ///< on the area as it is [Pa]: σ_xx, of shear σ_xy
  double across = 1.0;   ///< stretch along z
};

/// Where |dev ε| of a volume-preserving pull is `strain`, with its sign: the stretch, or γ.
[[nodiscard]] double pull_at(Pull pull, double strain);
/// The opposite: |dev ε| of a pull that preserves volume, with its sign.
[[nodiscard]] double pull_strain(Pull pull, double by);

/// The law with its damping, its Maxwell branches and its correction, followed from rest through
/// the stretches (γ) of `stops` one after the other, by the formulas of the solver's kernels
/// (classical/point_law.hpp) at |dev D| = `rate` [1/s]; free sides by Newton's method, so that no
/// stress is on them. Throws Error(kInput) for a stretch that is not above 0 or a rate that is not,
/// Error(kCompute) where no free sides are found.
[[nodiscard]] std::vector<CurvePoint> stress_curve(const Material& material, Pull pull,
                                                   std::span<const double> stops, double rate);

/// Kirchhoff stress [Pa] that acts beside a law's, of its elastic deformation gradient, as
/// effects::Term::stress() gives it.
using FurtherStress = std::function<Mat3d(const Mat3d& elastic)>;
/// The same with a further stress. A material of the published law has none: Error(kInput).
[[nodiscard]] std::vector<CurvePoint> stress_curve(const Material& material, Pull pull,
                                                   std::span<const double> stops, double rate,
                                                   const FurtherStress& further);

/// The same of the published law (neural/published_law.hpp), whose plastic net acts once in a
/// substep of kPublishedSubstep; a material of it goes the same way, without what acts beside it.
/// Its sides y and z need not move alike; `across` is that of z. Throws Error(kInput) besides where
/// the rate asks for more than kMostPublishedSubsteps.
[[nodiscard]] std::vector<CurvePoint> stress_curve(const PublishedWeights& weights, Pull pull,
                                                   std::span<const double> stops, double rate);
inline constexpr std::size_t kMostPublishedSubsteps = 20000;

/// `count` points either way of rest and rest itself, in the order of the stretches: up to where
/// |dev ε| would be `strain`, each way from rest. Shear: one way only, as the other mirrors it.
template <class Law>
[[nodiscard]] std::vector<CurvePoint> curve_about_rest(const Law& law, Pull pull, double strain,
                                                       std::size_t count, double rate) {
  std::vector<CurvePoint> all;
  for (const double way : {-1.0, 1.0}) {
    if (pull == Pull::kShear && way < 0.0) continue;
    std::vector<double> stops(count);
    for (std::size_t k = 0; k < count; ++k) {
      stops[k] = pull_at(pull, way * strain * double(k + 1) / double(count));
    }
    const std::vector<CurvePoint> found = stress_curve(law, pull, stops, rate);
    if (way < 0.0) {
      all.assign(found.rbegin(), found.rend());
    } else {
      all.push_back({pull == Pull::kShear ? 0.0 : 1.0, 0.0, 0.0, 1.0});
      all.insert(all.end(), found.begin(), found.end());
    }
  }
  if (pull == Pull::kShear) all.front().by = 0.0;
  return all;
}

}  // namespace matterfit::material
