// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/gradient_chain.hpp"

#include <algorithm>

#include "mpm/scene_check.hpp"

namespace matterfit::fit {

bool has_slopes(const Parameters& parameters, std::size_t run, const mpm::Scene& scene) {
  const auto total = std::count_if(scene.bodies.begin(), scene.bodies.end(), mpm::is_total);
  if (total > 0 && scene.bodies.size() > 1) return false;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!parameters.acts_on(i, run) || parameters.path(i).quantity->camera_slope) continue;
    if (!has_slope(parameters.path(i), scene)) return false;
  }
  return true;
}

void add_slopes(const Parameters& parameters, std::size_t run, const mpm::Scene& scene,
                const mpm::Gradient& gradient, std::span<double> sum) {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!parameters.acts_on(i, run) || parameters.path(i).quantity->camera_slope) continue;
    sum[i] += slope(gradient, scene, parameters.path(i));
  }
}

}  // namespace matterfit::fit
