// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <string_view>

namespace matterfit::job {

/// Numbers of a law that are fitted where nobody says which, beside the throw: keys of a job
/// document's `material`, of those that the law takes.
inline constexpr std::array<std::string_view, 8> kUsualNumbers{
    "E", "nu", "form_1", "form_2", "yield_stress", "viscosity", "friction_angle", "bulk_modulus"};

}  // namespace matterfit::job
