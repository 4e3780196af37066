// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_state.hpp"

#include <variant>

#include "job/fit_checkpoint.hpp"

namespace matterfit::job {
namespace {

constexpr const char* kSchemaName = "matterfit.fit-checkpoint/2";

Json to_json(const Eigen::VectorXd& vector) {
  return std::vector<double>(vector.data(), vector.data() + vector.size());
}

Eigen::VectorXd to_vector(const Json& json) {
  const auto values = json.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), Eigen::Index(values.size()));
}

Json to_json(const std::vector<fit::RunSteps>& all) {
  Json steps = Json::array();
  for (const fit::RunSteps& step : all) {
    steps.push_back({step.substeps, step.limit});
    if (!step.renewals.empty()) steps.back().push_back(step.renewals);
  }
  return steps;
}

std::vector<fit::RunSteps> to_steps(const Json& json) {
  std::vector<fit::RunSteps> steps;
  for (const Json& step : json) {
    steps.push_back({step.at(0).get<std::vector<int>>(), step.at(1).get<double>(), {}});
    if (step.size() > 2) step.at(2).get_to(steps.back().renewals);
  }
  return steps;
}

Json to_json(const std::vector<std::vector<fit::Standing>>& all) {
  Json stages = Json::array();
  for (const auto& stage : all) {
    Json standings = Json::array();
    for (const fit::Standing& standing : stage) {
      standings.push_back({standing.rms, standing.firm, standing.far, standing.early});
    }
    stages.push_back(std::move(standings));
  }
  return stages;
}

std::vector<std::vector<fit::Standing>> to_standings(const Json& json) {
  std::vector<std::vector<fit::Standing>> stages;
  for (const Json& stage : json) {
    std::vector<fit::Standing>& standings = stages.emplace_back();
    for (const Json& one : stage) {
      standings.push_back({one.at(0).get<double>(), one.at(1).get<bool>(), one.at(2).get<bool>(),
                           one.size() > 3 && one.at(3).get<bool>()});
    }
  }
  return stages;
}

constexpr const char* kNotBegun = "not begun";
constexpr const char* kInStage = "in stage";
constexpr const char* kFarOff = "far off";
constexpr const char* kFinished = "finished";
constexpr const char* kLeft = "left";

Json to_json(const fit::NotBegun& /*phase*/) { return {{"name", kNotBegun}}; }
Json to_json(const fit::InStage& /*phase*/) { return {{"name", kInStage}}; }
Json to_json(const fit::FarOff& /*phase*/) { return {{"name", kFarOff}}; }
Json to_json(const fit::Finished& phase) {
  return {{"name", kFinished}, {"converged", phase.converged}, {"reason", phase.reason}};
}
Json to_json(const fit::LeftEarly& phase) {
  const bool far = std::holds_alternative<fit::FarOff>(phase.then);
  return {{"name", kLeft}, {"reason", phase.reason}, {"then", far ? kFarOff : kInStage}};
}

fit::SearchPhase to_phase(const Json& json) {
  const auto name = json.at("name").get<std::string>();
  if (name == kInStage) return fit::InStage{};
  if (name == kFarOff) return fit::FarOff{};
  if (name == kFinished) {
    return fit::Finished{json.at("converged").get<bool>(), json.at("reason").get<std::string>()};
  }
  if (name == kLeft) {
    fit::LeftEarly left{json.at("reason").get<std::string>(), fit::InStage{}};
    if (json.at("then") == kFarOff) left.then = fit::FarOff{};
    return left;
  }
  return fit::NotBegun{};
}

Json to_json(const std::monostate& /*second*/) { return Json::object(); }
Json to_json(const fit::OtherStart& second) { return {{"other", second.values}}; }
Json to_json(const fit::FirstEnd& second) {
  return {{"first_end", second.values}, {"mean", second.mean}};
}

fit::SecondStart to_second(const Json& json) {
  if (json.contains("other")) return fit::OtherStart{json.at("other").get<std::vector<double>>()};
  if (json.contains("first_end")) {
    return fit::FirstEnd{json.at("first_end").get<std::vector<double>>(),
                         json.at("mean").get<double>()};
  }
  return std::monostate{};
}

Json to_json(const fit::LawState& law) {
  const auto as_json = [](const auto& alternative) { return to_json(alternative); };
  Json json = {{"law", law.law},
               {"values", law.values},
               {"phase", std::visit(as_json, law.phase)},
               {"second", std::visit(as_json, law.second)},
               {"candidates", law.candidates},
               {"torn", law.torn},
               {"rescanned", law.rescanned},
               {"stage", law.stage},
               {"first_stage", law.first_stage},
               {"repeats", law.repeats},
               {"stage_start", law.stage_start},
               {"steps", to_json(law.steps)},
               {"stand_in_steps", to_json(law.stand_in_steps)},
               {"refinements", law.refinements},
               {"standings", to_json(law.standings)},
               {"failed", law.failed},
               {"spared", law.spared},
               {"iterations", law.iterations},
               {"evaluations", law.evaluations},
               {"statements", law.statements}};
  if (law.search) json["search"] = search_json(*law.search);
  if (law.nearest) {
    json["nearest"] = {{"cost", law.nearest->cost},
                       {"point", to_json(law.nearest->point)},
                       {"worse", law.nearest->worse}};
  }
  return json;
}

fit::LawState to_law(const Json& json) {
  fit::LawState law;
  json.at("law").get_to(law.law);
  json.at("values").get_to(law.values);
  law.phase = to_phase(json.at("phase"));
  law.second = to_second(json.at("second"));
  json.at("candidates").get_to(law.candidates);
  json.at("torn").get_to(law.torn);
  json.at("rescanned").get_to(law.rescanned);
  json.at("spared").get_to(law.spared);
  json.at("stage").get_to(law.stage);
  json.at("first_stage").get_to(law.first_stage);
  json.at("repeats").get_to(law.repeats);
  json.at("stage_start").get_to(law.stage_start);
  law.steps = to_steps(json.at("steps"));
  law.stand_in_steps = to_steps(json.at("stand_in_steps"));
  json.at("refinements").get_to(law.refinements);
  if (json.contains("nearest")) {
    const Json& nearest = json.at("nearest");
    law.nearest = fit::Nearest{nearest.at("cost").get<double>(), to_vector(nearest.at("point")),
                               nearest.at("worse").get<int>()};
  }
  law.standings = to_standings(json.at("standings"));
  json.at("failed").get_to(law.failed);
  json.at("iterations").get_to(law.iterations);
  json.at("evaluations").get_to(law.evaluations);
  json.at("statements").get_to(law.statements);
  if (json.contains("search")) law.search = search_of(json.at("search"));
  return law;
}

}  // namespace

Json search_json(const fit::LeastSquaresState& state) {
  Json history = Json::array();
  for (const fit::LeastSquaresStep& step : state.history) {
    history.push_back({step.iteration, step.cost, step.damping, step.accepted});
  }
  Json trail = Json::array();
  for (const Eigen::VectorXd& point : state.trail) trail.push_back(to_json(point));
  return {{"point", to_json(state.point)},
          {"residual", to_json(state.residual)},
          {"cost", state.cost},
          {"damping", state.damping},
          {"iteration", state.iteration},
          {"evaluations", state.evaluations},
          {"finished", state.finished},
          {"converged", state.converged},
          {"reason", state.reason},
          {"own", state.own},
          {"anchor", to_json(state.anchor)},
          {"central", state.central},
          {"trail", trail},
          {"corrected", state.corrected},
          {"vain", state.vain},
          {"history", history}};
}

fit::LeastSquaresState search_of(const Json& json) {
  fit::LeastSquaresState state;
  state.point = to_vector(json.at("point"));
  state.residual = to_vector(json.at("residual"));
  json.at("cost").get_to(state.cost);
  json.at("damping").get_to(state.damping);
  json.at("iteration").get_to(state.iteration);
  json.at("evaluations").get_to(state.evaluations);
  json.at("finished").get_to(state.finished);
  json.at("converged").get_to(state.converged);
  json.at("reason").get_to(state.reason);
  json.at("own").get_to(state.own);
  state.anchor = to_vector(json.at("anchor"));
  json.at("central").get_to(state.central);
  for (const Json& point : json.at("trail")) state.trail.push_back(to_vector(point));
  json.at("corrected").get_to(state.corrected);
  json.at("vain").get_to(state.vain);
  for (const Json& step : json.at("history")) {
    state.history.push_back({step.at(0).get<int>(), step.at(1).get<double>(),
                             step.at(2).get<double>(), step.at(3).get<bool>()});
  }
  return state;
}

std::string format_fit_state(const FitState& state) {
  Json laws = Json::array();
  for (std::size_t k = 0; k < state.laws.size(); ++k) {
    laws.push_back(to_json(state.laws[k]));
    laws.back()["model"] = k < state.models.size() ? state.models[k] : Json();
  }
  const Json body = {{"inputs", state.inputs},
                     {"laws", laws},
                     {"law", state.law},
                     {"before", state.before},
                     {"before_failed", state.before_failed},
                     {"measured_before", state.measured_before},
                     {"history", state.history},
                     {"statements", state.statements},
                     {"seconds", state.seconds}};
  return format_checkpoint(kSchemaName, state.input_hash, body);
}

std::optional<FitState> read_fit_state(const std::filesystem::path& folder,
                                       const std::string& input_hash) {
  const Json file = read_checkpoint(folder);
  try {
    if (!is_checkpoint_of(file, kSchemaName)) return std::nullopt;
    const Json& json = file.at("state");
    FitState state;
    file.at("input_hash").get_to(state.input_hash);
    if (!input_hash.empty() && state.input_hash != input_hash) return std::nullopt;
    json.at("inputs").get_to(state.inputs);
    for (const Json& law : json.at("laws")) {
      state.laws.push_back(to_law(law));
      state.models.push_back(law.at("model"));
    }
    json.at("law").get_to(state.law);
    state.before = json.at("before");
    json.at("before_failed").get_to(state.before_failed);
    json.at("measured_before").get_to(state.measured_before);
    state.history = json.at("history").get<std::vector<Json>>();
    json.at("statements").get_to(state.statements);
    json.at("seconds").get_to(state.seconds);
    return state;
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

}  // namespace matterfit::job
