// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mpm/renewed_body.hpp"
#include "mpm/renewed_grid.hpp"
#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// In a substep from `time` in which a particle has gone wrong, before its nodes move: throws
/// UnstableError that names it and the reason. `displacement`: of the nodes, as RenewedGroup has
/// it [m].
template <class S>
[[noreturn]] void fail_renewed(const Scene& scene, const std::vector<RenewedBody<S>>& bodies,
                               const RenewedGrid& grid, const std::vector<double>& displacement,
                               double time);

extern template void fail_renewed<float>(const Scene&, const std::vector<RenewedBody<float>>&,
                                         const RenewedGrid&, const std::vector<double>&, double);
extern template void fail_renewed<double>(const Scene&, const std::vector<RenewedBody<double>>&,
                                          const RenewedGrid&, const std::vector<double>&, double);

}  // namespace matterfit::mpm
