// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "effects/effect_type.hpp"

namespace matterfit::effects {

/// The catalogue's rows that need no term: causes whose numbers a scene has already, by the paths
/// of those numbers in a document. `BODY` and `COLLIDER` stand for a name.
[[nodiscard]] const std::vector<EffectType>& scene_rows();

}  // namespace matterfit::effects
