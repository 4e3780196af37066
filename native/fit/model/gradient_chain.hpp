// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>

#include "fit/model/parameters.hpp"
#include "mpm/gradient.hpp"

/// From the derivatives by what a scene says (mpm/gradient.hpp) to those by the numbers of a fit.
namespace matterfit::fit {

/// Whether add_slopes() knows the derivative by every number that acts on the run's scene
/// (has_slope()); not where the scene has no adjoint.
[[nodiscard]] bool has_slopes(const Parameters& parameters, std::size_t run,
                              const mpm::Scene& scene);

/// Adds the derivatives by each number's physical value to `sum`, one each. `gradient` is of
/// `scene`, the run's with the values applied.
void add_slopes(const Parameters& parameters, std::size_t run, const mpm::Scene& scene,
                const mpm::Gradient& gradient, std::span<double> sum);

}  // namespace matterfit::fit
