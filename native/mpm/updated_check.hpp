// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mpm/scene.hpp"
#include "mpm/updated_grid.hpp"
#include "mpm/updated_member.hpp"

namespace matterfit::mpm {

/// After a substep from `time` in which a particle has gone wrong, and before those that change
/// their block have gone there: throws UnstableError that names it and the reason. `fastest`: the
/// largest displacement along an axis, in cells.
template <class S>
[[noreturn]] void fail_updated(const Scene& scene, const UpdatedGrid<S>& grid,
                               const std::vector<UpdatedMember<S>>& members, double time, double dt,
                               double fastest);

extern template void fail_updated<float>(const Scene&, const UpdatedGrid<float>&,
                                         const std::vector<UpdatedMember<float>>&, double, double,
                                         double);
extern template void fail_updated<double>(const Scene&, const UpdatedGrid<double>&,
                                          const std::vector<UpdatedMember<double>>&, double, double,
                                          double);

}  // namespace matterfit::mpm
