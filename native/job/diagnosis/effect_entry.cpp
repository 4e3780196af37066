// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/effect_entry.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

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

void take_shared(const mpm::Scene& scene, effects::Effect& effect) {
  const auto other = std::ranges::find_if(scene.effects, [&](const effects::Effect& there) {
    return there.type->name == effect.type->beside &&
           (there.body.empty() || there.body == effect.body);
  });
  if (other == scene.effects.end()) return;
  if (!other->keys.empty()) effect.keys.resize(effect.values.size());
  for (std::size_t p = 0; p < effect.type->parameters.size(); ++p) {
    const effects::EffectParameter& parameter = effect.type->parameters[p];
    const std::optional<std::size_t> same = other->type->find(parameter.key);
    if (!same) continue;
    std::copy_n(other->values.begin() + std::ptrdiff_t(other->type->offset(*same)), parameter.size,
                effect.values.begin() + std::ptrdiff_t(effect.type->offset(p)));
    if (other->keys.empty()) continue;
    std::copy_n(other->keys.begin() + std::ptrdiff_t(other->type->offset(*same)), parameter.size,
                effect.keys.begin() + std::ptrdiff_t(effect.type->offset(p)));
  }
}

void take_shared(const Json& scene, const effects::EffectType& type, Json& entry) {
  const auto there = scene.find("effects");
  if (there == scene.end()) return;
  for (const Json& other : *there) {
    const std::string body = other.value("body", std::string());
    if (other.value("effect", std::string()) != type.beside) continue;
    if (!body.empty() && body != entry.value("body", std::string())) continue;
    for (const effects::EffectParameter& parameter : type.parameters) {
      if (other.contains(parameter.key)) entry[parameter.key] = other.at(parameter.key);
    }
    return;
  }
}

bool has_effect(const mpm::Scene& scene, std::string_view type) {
  return std::any_of(scene.effects.begin(), scene.effects.end(),
                     [&](const effects::Effect& effect) { return effect.type->name == type; });
}

}  // namespace matterfit::job
