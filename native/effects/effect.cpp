// SPDX-License-Identifier: GPL-3.0-or-later
#include "effects/effect.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/error.hpp"
#include "effects/catalogue.hpp"

namespace matterfit::effects {
namespace {

/// Calls use(value) for what a number is and is keyed to.
template <class Use>
void for_each_value(const Effect& effect, std::size_t k, const Use& use) {
  if (!effect.keyed(k)) {
    use(effect.values[k]);
    return;
  }
  for (const double value : effect.keys[k].values) use(value);
}

}  // namespace

double Effect::largest(std::size_t k) const {
  double most = 0.0;
  for_each_value(*this, k, [&](double value) { most = std::max(most, std::abs(value)); });
  return most;
}

double Effect::largest_vector(std::size_t k) const {
  return Vec3d(largest(k), largest(k + 1), largest(k + 2)).norm();
}

Effect make_effect(const std::string& type) {
  Effect effect;
  effect.type = find_effect_type(type);
  if (effect.type == nullptr) throw_input("There is no effect '" + type + "'.");
  effect.name = type;
  for (const EffectParameter& parameter : effect.type->parameters) {
    std::vector<double> first = parameter.standard;
    first.resize(parameter.size, 0.0);
    effect.values.insert(effect.values.end(), first.begin(), first.end());
  }
  return effect;
}

bool is_neutral(const Effect& effect) {
  for (std::size_t i = 0; i < effect.type->parameters.size(); ++i) {
    const EffectParameter& parameter = effect.type->parameters[i];
    if (!parameter.neutral) continue;
    bool all = true;
    const std::size_t first = effect.type->offset(i);
    for (std::size_t k = first; k < first + parameter.size; ++k) {
      for_each_value(effect, k, [&](double value) { all = all && value == *parameter.neutral; });
    }
    if (all) return true;
  }
  return false;
}

void check_effect(const Effect& effect, const std::string& where) {
  if (effect.type == nullptr) throw_input(where + " has no type. Take one of the catalogue's.");
  if (effect.type->make == nullptr) {
    std::string message =
        where + ": '" + effect.type->name + "' is no term of its own: the scene says it elsewhere.";
    for (const std::string& path : effect.type->quantities) message += " Set " + path + ".";
    throw_input(message);
  }
  if (effect.values.size() != effect.type->size() ||
      (!effect.keys.empty() && effect.keys.size() != effect.values.size())) {
    throw_input(where + " has " + std::to_string(effect.values.size()) + " numbers; '" +
                effect.type->name + "' takes " + std::to_string(effect.type->size()) + ".");
  }
  for (std::size_t i = 0; i < effect.type->parameters.size(); ++i) {
    const EffectParameter& parameter = effect.type->parameters[i];
    const std::size_t first = effect.type->offset(i);
    for (std::size_t k = first; k < first + parameter.size; ++k) {
      for_each_value(effect, k, [&](double value) {
        if (std::isfinite(value) && value >= parameter.low && value <= parameter.high) return;
        std::ostringstream text;
        text << where << '.' << parameter.key << " = " << value << " must lie between "
             << parameter.low << " and " << parameter.high
             << (parameter.unit.empty() ? "" : " " + parameter.unit) << '.';
        throw_input(text.str());
      });
    }
  }
}

}  // namespace matterfit::effects
