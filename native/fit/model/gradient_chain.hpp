// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>

#include "fit/model/parameters.hpp"
#include "mpm/gradient.hpp"

/// From the derivatives by what a scene says (mpm/gradient.hpp) to those by the numbers of a fit.
namespace matterfit::fit {

/// Whether the derivative by every number that acts on the run is known: add_slopes() by those of
/// its scene (has_slope()), drawing by those that move cameras; not where the scene has no
/// adjoint.
[[nodiscard]] bool has_slopes(const Parameters& parameters, std::size_t run,
                              const mpm::Scene& scene);

/// Adds the derivatives by each of the scene's numbers, of its physical value, to `sum`, one each.
/// `gradient` is of `scene`, the run's with the values applied.
void add_slopes(const Parameters& parameters, std::size_t run, const mpm::Scene& scene,
                const mpm::Gradient& gradient, std::span<double> sum);

}  // namespace matterfit::fit
