// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/own_splats.hpp"

#include <algorithm>

namespace matterfit::fit {

std::vector<OwnSplats> carried(const std::vector<BodySplats>& all, const mpm::Scene& scene,
                               Arena& arena, const Interrupter* interrupter) {
  std::vector<OwnSplats> result;
  result.reserve(all.size());
  for (const BodySplats& one : all) {
    result.push_back({one.body, capture::CarriedSplats(one.splats, scene.bodies[one.body],
                                                       0.5 * scene.dx, arena, interrupter)});
  }
  return result;
}

bool drawn_by_splats(std::span<const OwnSplats> own, std::size_t bodies,
                     std::optional<std::size_t> body) {
  const auto has = [&](std::size_t b) {
    return std::ranges::any_of(own, [&](const OwnSplats& one) { return one.body == b; });
  };
  if (body) return has(*body);
  for (std::size_t b = 0; b < bodies; ++b) {
    if (!has(b)) return false;
  }
  return true;
}

}  // namespace matterfit::fit
