// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/updated_grid.hpp"
#include "mpm/updated_member.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

/// How the particles around its place share each attached mass of an updated body: by the quadratic
/// B-spline of the distance in cells of `dx` [m], tilted so that the shares' centre lies there as
/// well as positive shares can put it (local maximum entropy: Arroyo and Ortiz, Int. J. Numer.
/// Meth. Engng 65, 2006). Throws Error(kInput) for a mass that has no particle within 1½ cells.
[[nodiscard]] CarriedMasses carried_masses(const Body& body, double dx);

/// The attached masses of block `b` at `time`: adds their momentum and mass to its halo. They move
/// as their particles do, with the velocity gradient there. `carries` gets each particle that has a
/// share, if not null.
template <class S>
void apply_attached_masses(UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                           std::size_t b, double time, std::vector<UpdatedCarry<S>>* carries);

}  // namespace matterfit::mpm
