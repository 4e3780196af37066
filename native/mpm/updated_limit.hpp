// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "mpm/scene.hpp"
#include "mpm/updated_member.hpp"
#include "mpm/updated_terms.hpp"

namespace matterfit::mpm {

/// The largest stable substep of updated Lagrangian bodies in the frame that begins [s] and what
/// sets it: elastic waves and contact, viscosity, the drag of terms, the way in one substep.
/// `min_j`: the smallest volume ratio of the substep before; `max_speed`: of any particle [m/s];
/// `pull`: the largest acceleration by gravity and terms [m/s²]. Throws what
/// BodyTerms::check_step() does.
template <class S>
[[nodiscard]] std::pair<double, std::string> updated_limit(
    const Scene& scene, const std::vector<UpdatedMember<S>>& members, const UpdatedTerms<S>& terms,
    double min_j, double max_speed, double pull);

extern template std::pair<double, std::string> updated_limit<float>(
    const Scene&, const std::vector<UpdatedMember<float>>&, const UpdatedTerms<float>&, double,
    double, double);
extern template std::pair<double, std::string> updated_limit<double>(
    const Scene&, const std::vector<UpdatedMember<double>>&, const UpdatedTerms<double>&, double,
    double, double);

}  // namespace matterfit::mpm
