// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/shaking.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "effects/effect_type.hpp"
#include "job/diagnosis/effect_entry.hpp"

namespace matterfit::job {
namespace {

constexpr const char* kShakes = "frame_acceleration";
/// A set of slopes takes six simulations for each.
constexpr std::size_t kFrequencies = 4;
/// Periods in the recording: a sway that has not come back twice is any smooth acceleration.
constexpr double kFewestPeriods = 2.0;
/// Of the frame rate: four samples a period.
constexpr double kHighest = 0.25;
/// In the acceleration's scale: at high frequencies a hundredth of it moves a body by less than the
/// last digit of single precision.
constexpr double kFirstStep = 0.1;

/// The parts of the cosine and of the sine, as two effects of the catalogue.
std::array<effects::Effect, 2> shaken(double frequency, std::span<const double> v) {
  constexpr std::array<const char*, 2> kNames = {"shaking cosine", "shaking sine"};
  constexpr std::array<double, 2> kPhases = {0.0, -90.0};
  std::array<effects::Effect, 2> parts;
  for (std::size_t part = 0; part < parts.size(); ++part) {
    effects::Effect& effect = parts[part];
    effect = effects::make_effect(kShakes);
    effect.name = kNames[part];
    const effects::EffectType& type = *effect.type;
    const std::size_t first = type.offset(*type.find("acceleration"));
    for (std::size_t axis = 0; axis < 3; ++axis) effect.values[first + axis] = v[3 * part + axis];
    effect.values[type.offset(*type.find("frequency"))] = frequency;
    effect.values[type.offset(*type.find("phase"))] = kPhases[part];
  }
  return parts;
}

}  // namespace

std::optional<Cause> shaking(const mpm::Scene& scene, double duration) {
  const double lowest = kFewestPeriods / duration;
  const double highest = kHighest * scene.fps;
  if (!(lowest < highest) || has_effect(scene, kShakes)) return std::nullopt;
  const effects::EffectType& type = *effects::make_effect(kShakes).type;
  const effects::EffectParameter& acceleration = type.parameters[*type.find("acceleration")];
  Cause cause;
  cause.row.name = kShakes;
  cause.row.scope = "shared";
  cause.row.group = "outside";
  cause.row.sentence = "What the body stands in shakes {variant}: {value}.";
  cause.row.confused_with = {"wind", "force_field", "camera_drift"};
  for (const char* part : {"cosine", "sine"}) {
    for (int axis = 0; axis < 3; ++axis) {
      diagnose::Number& number = cause.row.numbers.emplace_back();
      number.name = fmt::format("{}[{}]", part, axis);
      number.unit = acceleration.unit;
      number.scale = acceleration.scale;
      number.first_step = kFirstStep * acceleration.scale;
      number.low = acceleration.low;
      number.high = acceleration.high;
    }
  }
  std::vector<double> frequencies;
  for (std::size_t k = 0; k < kFrequencies; ++k) {
    const double share = double(k) / double(kFrequencies - 1);
    frequencies.push_back(lowest * std::pow(highest / lowest, share));
    cause.row.variants.push_back(fmt::format("{:.3g} times a second", frequencies.back()));
  }
  cause.apply = [frequencies](std::span<const double> v, int variant, mpm::Scene& there) {
    for (effects::Effect& part : shaken(frequencies[static_cast<std::size_t>(variant)], v)) {
      there.effects.push_back(std::move(part));
    }
  };
  cause.write = [frequencies](std::span<const double> v, int variant, Json& there) {
    for (const effects::Effect& part : shaken(frequencies[static_cast<std::size_t>(variant)], v)) {
      there["effects"].push_back(effect_entry(part));
    }
  };
  return cause;
}

}  // namespace matterfit::job
