// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/effect_entry.hpp"

#include <algorithm>
#include <vector>

#include "effects/effect_type.hpp"

namespace matterfit::job {

Json effect_entry(const effects::Effect& effect) {
  Json entry = {{"effect", effect.type->name}};
  if (effect.name != effect.type->name) entry["name"] = effect.name;
  if (!effect.body.empty()) entry["body"] = effect.body;
  for (std::size_t p = 0; p < effect.type->parameters.size(); ++p) {
    const effects::EffectParameter& parameter = effect.type->parameters[p];
    const auto begin = effect.values.begin() + static_cast<std::ptrdiff_t>(effect.type->offset(p));
    const std::vector<double> values(begin, begin + static_cast<std::ptrdiff_t>(parameter.size));
    entry[parameter.key] = parameter.size == 1 ? Json(values.front()) : Json(values);
  }
  return entry;
}

bool has_effect(const mpm::Scene& scene, std::string_view type) {
  return std::any_of(scene.effects.begin(), scene.effects.end(),
                     [&](const effects::Effect& effect) { return effect.type->name == type; });
}

}  // namespace matterfit::job
