// SPDX-License-Identifier: GPL-3.0-or-later
#include "effects/effect_type.hpp"

namespace matterfit::effects {

std::size_t EffectType::size() const { return offset(parameters.size()); }

std::size_t EffectType::offset(std::size_t parameter) const {
  std::size_t sum = 0;
  for (std::size_t i = 0; i < parameter; ++i) sum += parameters[i].size;
  return sum;
}

std::optional<std::size_t> EffectType::find(std::string_view key) const {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].key == key) return i;
  }
  return std::nullopt;
}

}  // namespace matterfit::effects
