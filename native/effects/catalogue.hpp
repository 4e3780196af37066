// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>
#include <vector>

#include "effects/effect_type.hpp"

namespace matterfit::effects {

/// Every effect that a scene may have or a diagnosis may name, in the order in which they are
/// shown. A row's address stays the same for the whole run of the program.
[[nodiscard]] const std::vector<const EffectType*>& catalogue();

/// The row of this name, or null.
[[nodiscard]] const EffectType* find_effect_type(std::string_view name);

}  // namespace matterfit::effects
