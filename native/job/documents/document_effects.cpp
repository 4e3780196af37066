// SPDX-License-Identifier: GPL-3.0-or-later
#include "effects/catalogue.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/read_keyed.hpp"

namespace matterfit::job {
namespace {

const effects::EffectType& read_type(const JsonValue& value) {
  const std::string name = value.string();
  std::vector<std::string> names;
  for (const effects::EffectType* row : effects::catalogue()) {
    if (row->name != name) {
      if (row->make != nullptr) names.push_back(row->name);
      continue;
    }
    if (row->make != nullptr) return *row;
    std::string message = "'" + name + "' is not set here but by";
    for (std::size_t i = 0; i < row->quantities.size(); ++i) {
      message += (i == 0 ? " " : " or ") + row->quantities[i];
    }
    value.refuse(message + ".");
  }
  std::string message = "there is no effect '" + name + "'.";
  if (const auto near = nearest(name, names)) {
    message += " Did you mean '" + *near + "'?";
  } else {
    message += " There are:";
    for (const std::string& other : names) message += " " + other;
    message += ".";
  }
  value.refuse(message);
}

ByFrame<std::vector<double>> read_parameter(const JsonValue& value,
                                            const effects::EffectParameter& parameter) {
  const Range range{parameter.low, parameter.high, false, parameter.unit};
  const auto read = [&](const JsonValue& one) {
    if (parameter.size == 1) return std::vector<double>{one.number(range)};
    (void)one.vec3();  // refuses what is no vector
    std::vector<double> components;
    components.reserve(parameter.size);
    for (const JsonValue& item : one.items()) components.push_back(item.number(range));
    return components;
  };
  const bool is_keyed = value.json().is_object();
  if (is_keyed && !parameter.may_be_keyed) value.refuse("this number cannot be keyed.");
  return read_keyed<std::vector<double>>(value, read);
}

}  // namespace

EffectDoc read_effect(const JsonValue& value, const SceneDoc& scene) {
  JsonObject object(value);
  EffectDoc effect;
  effect.type = &read_type(object.require("effect"));
  effect.name = object.string("name", effect.type->name);
  if (const auto body = object.find("body")) effect.body = resolve_body(body, value, scene);
  for (const effects::EffectParameter& parameter : effect.type->parameters) {
    if (const auto given = object.find(parameter.key.c_str())) {
      effect.values.push_back(read_parameter(*given, parameter));
    } else if (!parameter.standard.empty()) {
      effect.values.emplace_back(parameter.standard);
    } else {
      (void)object.require(parameter.key.c_str());
    }
  }
  object.finish();
  return effect;
}

}  // namespace matterfit::job
