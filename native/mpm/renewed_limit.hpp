// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "mpm/renewed_body.hpp"
#include "mpm/renewed_contact.hpp"
#include "mpm/renewed_terms.hpp"
#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// The largest stable substep of renewed bodies in the frame that begins [s] and what sets it:
/// elastic waves and contact, viscosity, the drag of terms, the way in one substep. `contacts` one
/// a body; `min_j`: the smallest elastic volume ratio of the substep before; `speed`: the fastest
/// that anything will be in the frame [m/s].
template <class S>
[[nodiscard]] std::pair<double, std::string> renewed_limit(
    const Scene& scene, const std::vector<RenewedBody<S>>& bodies,
    const std::vector<RenewedContact<S>>& contacts, const RenewedTerms<S>& terms, double min_j,
    double speed);

extern template std::pair<double, std::string> renewed_limit<float>(
    const Scene&, const std::vector<RenewedBody<float>>&, const std::vector<RenewedContact<float>>&,
    const RenewedTerms<float>&, double, double);
extern template std::pair<double, std::string> renewed_limit<double>(
    const Scene&, const std::vector<RenewedBody<double>>&,
    const std::vector<RenewedContact<double>>&, const RenewedTerms<double>&, double, double);

}  // namespace matterfit::mpm
