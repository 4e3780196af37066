// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>

#include "effects/effect.hpp"
#include "job/documents/document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// An effect as an entry of a document's scene.effects.
[[nodiscard]] Json effect_entry(const effects::Effect& effect);

/// Whether a scene has an effect of this type already.
[[nodiscard]] bool has_effect(const mpm::Scene& scene, std::string_view type);

}  // namespace matterfit::job
