// SPDX-License-Identifier: GPL-3.0-or-later
#include "effects/catalogue.hpp"

#include "effects/rows.hpp"
#include "effects/scene_rows.hpp"

namespace matterfit::effects {

const std::vector<const EffectType*>& catalogue() {
  static const std::vector<const EffectType*> rows = [] {
    std::vector<const EffectType*> all = {
        &drag_linear(),
        &drag_quadratic(),
        &wind(),
        &buoyancy(),
        &force_field(),
        &vortex(),
        &frame_acceleration(),
        &stiffness_inclusion(),
        &stiffness_gradient(),
        &fibres(),
        &strain_stiffening(),
        &second_invariant(),
    };
    all.reserve(all.size() + scene_rows().size());
    for (const EffectType& row : scene_rows()) all.push_back(&row);
    return all;
  }();
  return rows;
}

const EffectType* find_effect_type(std::string_view name) {
  for (const EffectType* row : catalogue()) {
    if (row->name == name) return row;
  }
  return nullptr;
}

}  // namespace matterfit::effects
