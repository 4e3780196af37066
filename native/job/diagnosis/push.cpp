// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/push.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "effects/effect_type.hpp"
#include "job/diagnosis/effect_entry.hpp"
#include "job/diagnosis/extent.hpp"

namespace matterfit::job {
namespace {

constexpr const char* kField = "force_field";
/// Radius of a field that is everywhere, in longest sides of the body.
constexpr double kEverywhere = 1e4;
/// Radius of a gust about the body, in longest sides.
constexpr double kAbout = 1.25;
/// Half of a field's strength is left at this share of its radius: (1 − q²)³ = .5.
constexpr double kHalfway = 0.4543;

struct Field {
  Vec3d center;
  double radius;
  double begin;
  double end;  ///< not after `begin`: it acts all the time
};

bool lasts(const Field& field) { return field.end > field.begin; }

/// A time [s] after the scene's first frame, and whether a field acts from then on.
struct Switch {
  double time;
  bool on;
};

/// The switches of a field that lasts, in order; the first is at the first frame or after it.
std::vector<Switch> switches_of(const Field& field) {
  std::vector<Switch> switches = {{field.begin, true}, {field.end, false}};
  if (field.begin > 0.0) switches.insert(switches.begin(), {0.0, false});
  return switches;
}

void set(effects::Effect& effect, const char* key, std::size_t component, double value) {
  effect.values[effect.type->offset(*effect.type->find(key)) + component] = value;
}

effects::Effect placed(const Field& field) {
  effects::Effect effect = effects::make_effect(kField);
  for (std::size_t axis = 0; axis < 3; ++axis) set(effect, "center", axis, field.center[int(axis)]);
  set(effect, "radius", 0, field.radius);
  return effect;
}

effects::Effect acting(const Field& field, std::span<const double> v) {
  effects::Effect effect = placed(field);
  if (!lasts(field)) {
    for (std::size_t axis = 0; axis < 3; ++axis) set(effect, "acceleration", axis, v[axis]);
    return effect;
  }
  const std::size_t first = effect.type->offset(*effect.type->find("acceleration"));
  effect.keys.resize(effect.values.size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    shape::Keyed<double>& keys = effect.keys[first + axis];
    for (const Switch& at : switches_of(field)) {
      keys.times.push_back(at.time);
      keys.values.push_back(at.on ? v[axis] : 0.0);
    }
    keys.step = true;
  }
  return effect;
}

std::vector<diagnose::Number> numbers_of() {
  const effects::EffectType& type = *effects::make_effect(kField).type;
  const effects::EffectParameter& acceleration = type.parameters[*type.find("acceleration")];
  std::vector<diagnose::Number> numbers(3);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    numbers[axis].name = fmt::format("acceleration[{}]", axis);
    numbers[axis].unit = acceleration.unit;
    numbers[axis].scale = acceleration.scale;
    numbers[axis].low = acceleration.low;
    numbers[axis].high = acceleration.high;
  }
  return numbers;
}

}  // namespace

std::optional<Cause> push(const std::vector<Encounter>& encounters, const mpm::Scene& scene) {
  const auto found = std::ranges::find_if(encounters, [](const auto& e) { return e.lasts > 0.0; });
  if (found == encounters.end() || has_effect(scene, kField)) return std::nullopt;
  const double size = extent_of(scene.bodies.front()).size;
  const double begin = std::max(0.0, found->time);
  const double end = found->time + found->lasts;
  if (!(end > begin)) return std::nullopt;
  std::vector<Field> fields;
  Cause cause;
  cause.row.name = kField;
  cause.row.scope = "shared";
  cause.row.group = "outside";
  cause.row.sentence = "Something that the scene does not have pushes the body {variant}: {value}.";
  cause.row.confused_with = {"wind", "hidden_collider"};
  cause.row.numbers = numbers_of();
  const std::string when = fmt::format("from {:.3g} to {:.3g} s", begin, end);
  const Vec3d& at = found->point;
  const auto add = [&](double radius, bool briefly) {
    fields.push_back({at, radius, begin, briefly ? end : begin});
    std::string where = fmt::format("within {:.3g} m of ({:.3g}, {:.3g}, {:.3g}) m", radius, at.x(),
                                    at.y(), at.z());
    if (briefly) where += ", " + when;
    cause.row.variants.push_back(std::move(where));
  };
  fields.push_back({at, kEverywhere * size, begin, end});
  cause.row.variants.push_back(when);
  add(kAbout * size, true);
  // One that it flies through, half as strong where it was pushed half as much.
  add(std::max(size, 0.5 * found->reach / kHalfway), false);
  cause.apply = [fields](std::span<const double> v, int variant, mpm::Scene& there) {
    there.effects.push_back(acting(fields[static_cast<std::size_t>(variant)], v));
  };
  cause.write = [fields, first = scene.first_frame, fps = scene.fps](std::span<const double> v,
                                                                     int variant, Json& there) {
    const Field& field = fields[static_cast<std::size_t>(variant)];
    Json entry = effect_entry(placed(field));
    const Json pushed = {v[0], v[1], v[2]};
    if (lasts(field)) {
      Json frames = Json::array();
      Json values = Json::array();
      for (const Switch& at : switches_of(field)) {
        frames.push_back(first + at.time * fps);
        values.push_back(at.on ? pushed : Json({0.0, 0.0, 0.0}));
      }
      entry["acceleration"] = {{"frames", frames}, {"values", values}, {"interpolation", "step"}};
    } else {
      entry["acceleration"] = pushed;
    }
    there["effects"].push_back(std::move(entry));
  };
  return cause;
}

}  // namespace matterfit::job
