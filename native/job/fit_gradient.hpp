// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>

#include "job/fit_parameters.hpp"
#include "mpm/gradient.hpp"

/// From the derivatives by what a scene says (mpm/gradient.hpp) to those by the numbers of a fit.
namespace matterfit::job {

/// Whether add_gradient() knows the derivative by every number that acts on the scene: not by where
/// a body is placed, as the points that are looked at are bound anew; nor by when a recording
/// began; nor by the height of a ground that updated bodies may meet node by node, who do not feel
/// it; and not where the scene has no adjoint.
[[nodiscard]] bool has_gradient(const FitParameters& parameters, std::size_t scene_index,
                                const mpm::Scene& scene);

/// Adds the derivatives by each number's physical value to `sum`, one each. `gradient` is of
/// `scene`, the one of that index with the values applied.
void add_gradient(const FitParameters& parameters, std::size_t scene_index, const mpm::Scene& scene,
                  const mpm::Gradient& gradient, std::span<double> sum);

}  // namespace matterfit::job
