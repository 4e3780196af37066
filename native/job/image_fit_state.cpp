// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_fit_state.hpp"

#include <cmath>

#include "job/fit_checkpoint.hpp"
#include "job/fit_state.hpp"

namespace matterfit::job {
namespace {

constexpr const char* kImageSchema = "matterfit.image-fit-checkpoint/2";

}  // namespace

double cost_of(ImagePhase phase) {
  switch (phase) {
    case ImagePhase::kPosesWide:
    case ImagePhase::kPosesNarrow:
      return 0.05;
    case ImagePhase::kThrow:
      return 0.2;
    default:
      return 1.0;
  }
}

double searched_share(double simulations, std::size_t numbers) {
  // Fits of eight and nine numbers, a throw among them, took 100 to 260. How many there will be is
  // not known: half of what is left is done with each half of the usual, so that the time that
  // seems left falls, also where there are twice as many.
  constexpr double kANumber = 12.0;
  const double usual = kANumber * double(numbers + 1);
  return 1.0 - std::exp2(-2.0 * simulations / usual);
}

std::vector<double> best_values(const ImageFitState& state) {
  const bool goes_on = state.phase != ImagePhase::kDone && state.search;
  if (!goes_on || state.search->iteration == 0) return state.values;
  return state.history.back().at("values").get<std::vector<double>>();
}

std::string format_image_fit_state(const ImageFitState& state) {
  Json body = {{"inputs", state.inputs},
               {"phase", static_cast<int>(state.phase)},
               {"values", state.values},
               {"stepped_at", state.stepped_at},
               {"sized_at", state.sized_at},
               {"coloured_at", state.coloured_at},
               {"refinements", state.refinements},
               {"before", state.before},
               {"history", state.history},
               {"evaluations", state.evaluations},
               {"iterations", state.iterations},
               {"seconds", state.seconds},
               {"simulated", state.simulated},
               {"beginnings", state.beginnings},
               {"agreed", state.agreed ? Json(*state.agreed) : Json()}};
  if (state.search) body["search"] = search_json(*state.search);
  return format_checkpoint(kImageSchema, state.input_hash, body);
}

std::optional<ImageFitState> read_image_fit_state(const std::filesystem::path& folder) {
  const Json file = read_checkpoint(folder);
  try {
    if (!is_checkpoint_of(file, kImageSchema)) return std::nullopt;
    const Json& json = file.at("state");
    ImageFitState state;
    file.at("input_hash").get_to(state.input_hash);
    json.at("inputs").get_to(state.inputs);
    const int phase = json.at("phase").get<int>();
    if (phase < 0 || phase > static_cast<int>(ImagePhase::kDone)) return std::nullopt;
    state.phase = static_cast<ImagePhase>(phase);
    json.at("values").get_to(state.values);
    json.at("stepped_at").get_to(state.stepped_at);
    json.at("sized_at").get_to(state.sized_at);
    json.at("coloured_at").get_to(state.coloured_at);
    json.at("refinements").get_to(state.refinements);
    state.before = json.at("before");
    state.history = json.at("history").get<std::vector<Json>>();
    json.at("evaluations").get_to(state.evaluations);
    json.at("iterations").get_to(state.iterations);
    json.at("seconds").get_to(state.seconds);
    state.simulated = json.value("simulated", 0.0);
    json.at("beginnings").get_to(state.beginnings);
    if (json.contains("agreed") && json.at("agreed").is_number()) {
      state.agreed = json.at("agreed").get<double>();
    }
    if (json.contains("search")) state.search = search_of(json.at("search"));
    return state;
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

}  // namespace matterfit::job
