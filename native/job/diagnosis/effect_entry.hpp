// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "effects/effect.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {

/// An effect as an entry of a document's scene.effects.
[[nodiscard]] Json effect_entry(const effects::Effect& effect);

}  // namespace matterfit::job
