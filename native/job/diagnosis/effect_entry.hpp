// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>

#include "effects/effect.hpp"
#include "effects/effect_type.hpp"
#include "job/documents/document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// An effect as an entry of a document's scene.effects.
[[nodiscard]] Json effect_entry(const effects::Effect& effect);

/// Gives an effect the numbers that it has in common with the one it stands beside
/// (EffectType::beside), where the scene has one on its body.
void take_shared(const mpm::Scene& scene, effects::Effect& effect);
/// The same between entries of a document's scene.effects.
void take_shared(const Json& scene, const effects::EffectType& type, Json& entry);

/// Whether a scene has an effect of this type already.
[[nodiscard]] bool has_effect(const mpm::Scene& scene, std::string_view type);

}  // namespace matterfit::job
