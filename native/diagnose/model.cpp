// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "base/error.hpp"

namespace matterfit::diagnose {
namespace {

void check_capture(const Capture& capture) {
  const std::size_t samples = capture.times.size() * capture.rest.size();
  if (samples == 0) {
    throw_input(fmt::format("Capture '{}' has {} frames and {} tracks; expected some of both.",
                            capture.name, capture.times.size(), capture.rest.size()));
  }
  if (std::adjacent_find(capture.times.begin(), capture.times.end(), std::greater_equal<>()) !=
      capture.times.end()) {
    throw_input(fmt::format("Capture '{}': its times do not ascend.", capture.name));
  }
  if (capture.use.size() != samples || capture.positions.size() != Eigen::Index(3 * samples)) {
    throw_input(
        fmt::format("Capture '{}' has {} frames × {} tracks, but {} uses and {} "
                    "coordinates; expected {} and {}.",
                    capture.name, capture.times.size(), capture.rest.size(), capture.use.size(),
                    capture.positions.size(), samples, 3 * samples));
  }
  if (!capture.positions.allFinite()) {
    throw_input(
        fmt::format("Capture '{}' has positions that are not finite. Mark them as ignored "
                    "and set them to 0.",
                    capture.name));
  }
  const auto per_frame = [&](std::size_t count) {
    return count == 0 || count == capture.times.size();
  };
  if (!per_frame(capture.frames.size()) || !per_frame(capture.at_rest.size())) {
    throw_input(fmt::format("Capture '{}' has {} frames, {} frame numbers and {} marks of rest.",
                            capture.name, capture.times.size(), capture.frames.size(),
                            capture.at_rest.size()));
  }
}

void check_effect(const Effect& effect, int captures) {
  if (effect.numbers.empty()) {
    throw_input(fmt::format("Effect '{}' has no numbers.", effect.name));
  }
  const bool vector =
      effect.observation == Observation::kDrift || effect.observation == Observation::kOffset;
  if (effect.observation != Observation::kNone &&
      effect.numbers.size() != (vector ? std::size_t{3} : std::size_t{1})) {
    throw_input(fmt::format("Effect '{}' has {} numbers; an observation of its kind has {}.",
                            effect.name, effect.numbers.size(), vector ? 3 : 1));
  }
  for (const Number& number : effect.numbers) {
    if (!(number.scale > 0.0) || !(number.first_step >= 0.0) || !(number.low <= number.neutral) ||
        !(number.neutral <= number.high) || !(number.low < number.high)) {
      throw_input(
          fmt::format("Effect '{}', number '{}': scale {:g}, first step {:g}, bounds [{:g}, "
                      "{:g}] about {:g}; expected a scale above 0 and bounds about the "
                      "neutral value.",
                      effect.name, number.name, number.scale, number.first_step, number.low,
                      number.high, number.neutral));
    }
  }
  for (const int capture : effect.captures) {
    if (capture < 0 || capture >= captures) {
      throw_input(fmt::format("Effect '{}' acts in capture {}, and there are {}.", effect.name,
                              capture, captures));
    }
  }
}

}  // namespace

std::vector<Eigen::Index> nuisances_of_times(const Model& model) {
  std::vector<Eigen::Index> result = model.corrections();
  const std::vector<Eigen::Index> states = model.state_errors();
  result.insert(result.end(), states.begin(), states.end());
  std::ranges::sort(result);
  return result;
}

void check(const Model& model) {
  if (model.captures().empty()) throw_input("There is no capture to diagnose.");
  for (const Capture& capture : model.captures()) check_capture(capture);
  for (const fit::Parameter& parameter : model.parameters()) fit::check(parameter);
  const int captures = int(model.captures().size());
  for (const Effect& effect : model.effects()) check_effect(effect, captures);
  const std::vector<int> own = model.own_capture();
  if (own.size() != model.parameters().size()) {
    throw_input(fmt::format("{} parameters, but captures of {} of them.", model.parameters().size(),
                            own.size()));
  }
}

}  // namespace matterfit::diagnose
