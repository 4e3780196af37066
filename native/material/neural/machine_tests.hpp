// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "material/neural/isotropic_weights.hpp"
#include "material/stress_curves.hpp"

/// The isotropic neural law from what a testing machine measured of a rubber.
namespace matterfit::material {

/// Nominal stresses [Pa] at stretches (γ) of a specimen that keeps its volume.
struct MachineTest {
  Pull pull = Pull::kUniaxial;
  std::vector<double> by;
  std::vector<double> nominal;
};

/// The law whose nominal stresses are those of the tests, relative to their size and half of their
/// mean, by Levenberg–Marquardt on the weights of μ and the shape units from a neo-Hookean. Tests
/// say nothing of stretches on the side that they do not show (pressed, or pulled along two axes,
/// which is the same but for a pressure; or pulled): there, to three quarters of their largest
/// logarithmic strain along two axes, it is held to the neo-Hookean nearest to the tests, with less
/// weight. `poisson_ratio` sets κ. It never yields. Throws Error(kInput) where tests are empty,
/// their lists differ in length, a stretch is not above 0, or a number is not finite, and
/// Error(kCompute) if no step improves the start.
[[nodiscard]] IsotropicWeights regress_machine_tests(std::span<const MachineTest> tests,
                                                     double poisson_ratio);

/// Shear modulus [Pa] of the neo-Hookean of least such error.
[[nodiscard]] double neo_hookean_of_tests(std::span<const MachineTest> tests);

/// 1 − Σ(P − P*)²/Σ(P* − mean P*)².
[[nodiscard]] double r_squared(std::span<const double> found, std::span<const double> measured);

}  // namespace matterfit::material
