// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_state.hpp"

#include "job/fit_checkpoint.hpp"

namespace matterfit::job {
namespace {

constexpr const char* kSchemaName = "matterfit.fit-checkpoint/1";

Json to_json(const Eigen::VectorXd& vector) {
  return std::vector<double>(vector.data(), vector.data() + vector.size());
}

Eigen::VectorXd to_vector(const Json& json) {
  const auto values = json.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), Eigen::Index(values.size()));
}

Json to_json(const std::vector<fit::RunSteps>& all) {
  Json steps = Json::array();
  for (const fit::RunSteps& step : all) steps.push_back({step.substeps, step.limit});
  return steps;
}

std::vector<fit::RunSteps> to_steps(const Json& json) {
  std::vector<fit::RunSteps> steps;
  for (const Json& step : json) {
    steps.push_back({step.at(0).get<std::vector<int>>(), step.at(1).get<double>()});
  }
  return steps;
}

Json to_json(const std::vector<std::vector<fit::Standing>>& all) {
  Json stages = Json::array();
  for (const auto& stage : all) {
    Json standings = Json::array();
    for (const fit::Standing& standing : stage) {
      standings.push_back({standing.rms, standing.firm, standing.far});
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
      standings.push_back({one.at(0).get<double>(), one.at(1).get<bool>(), one.at(2).get<bool>()});
    }
  }
  return stages;
}

Json to_json(const fit::LawState& law) {
  Json json = {{"law", law.law},
               {"values", law.values},
               {"begun", law.begun},
               {"candidates", law.candidates},
               {"torn", law.torn},
               {"other", law.other},
               {"ended", law.ended},
               {"ended_mean", law.ended_mean},
               {"scan_due", law.scan_due},
               {"rescanned", law.rescanned},
               {"stage", law.stage},
               {"first_stage", law.first_stage},
               {"repeats", law.repeats},
               {"stage_start", law.stage_start},
               {"steps", to_json(law.steps)},
               {"stand_in_steps", to_json(law.stand_in_steps)},
               {"refinements", law.refinements},
               {"standings", to_json(law.standings)},
               {"finished", law.finished},
               {"converged", law.converged},
               {"reason", law.reason},
               {"failed", law.failed},
               {"left", law.left},
               {"spared", law.spared},
               {"iterations", law.iterations},
               {"evaluations", law.evaluations},
               {"statements", law.statements}};
  if (law.search) json["search"] = search_json(*law.search);
  return json;
}

fit::LawState to_law(const Json& json) {
  fit::LawState law;
  json.at("law").get_to(law.law);
  json.at("values").get_to(law.values);
  json.at("begun").get_to(law.begun);
  // Not in states from before there were any.
  law.candidates = json.value("candidates", law.candidates);
  law.torn = json.value("torn", false);
  law.other = json.value("other", law.other);
  law.ended = json.value("ended", law.ended);
  law.ended_mean = json.value("ended_mean", 0.0);
  law.scan_due = json.value("scan_due", false);
  law.rescanned = json.value("rescanned", false);
  json.at("stage").get_to(law.stage);
  law.first_stage = json.value("first_stage", law.first_stage);
  json.at("repeats").get_to(law.repeats);
  json.at("stage_start").get_to(law.stage_start);
  law.steps = to_steps(json.at("steps"));
  law.stand_in_steps = to_steps(json.at("stand_in_steps"));
  json.at("refinements").get_to(law.refinements);
  law.standings = to_standings(json.value("standings", Json::array()));
  json.at("finished").get_to(law.finished);
  json.at("converged").get_to(law.converged);
  json.at("reason").get_to(law.reason);
  json.at("failed").get_to(law.failed);
  law.left = json.value("left", false);
  law.spared = json.value("spared", false);
  json.at("iterations").get_to(law.iterations);
  json.at("evaluations").get_to(law.evaluations);
  law.statements = json.value("statements", law.statements);
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
  // Not in states from before there were any.
  state.central = json.value("central", false);
  for (const Json& point : json.value("trail", Json::array())) {
    state.trail.push_back(to_vector(point));
  }
  state.corrected = json.value("corrected", state.corrected);
  state.vain = json.value("vain", 0);
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
