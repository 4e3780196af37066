// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_weights.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.hpp"
#include "base/file.hpp"
#include "fit/data/follow.hpp"
#include "job/documents/fit_path.hpp"
#include "job/documents/safetensors.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/latent.hpp"

namespace matterfit::job {
namespace {

/// So many steps that predict worse end the search.
constexpr int kMostWorse = 4;
constexpr const char* kRow = "material.weight_moves[#]";

/// The builder's scenes with weights that can be moved.
fit::SceneBuilder with_weights(fit::SceneBuilder build, std::string body) {
  return [build = std::move(build), body = std::move(body)](double level, Arena& arena,
                                                            const Interrupter& interrupter) {
    mpm::Scene scene = build(level, arena, interrupter);
    std::vector<double>& moves = scene.bodies[fit::body_index(scene, body)].material.weight_moves;
    moves.resize(material::kIsotropicElastic, 0.0);
    return scene;
  };
}

struct Means {
  std::optional<double> held;
  std::optional<double> seen;
};

Means means_of(LawFit& fit, const LawState& state) {
  std::string failure;
  const auto errors = fit.errors(state, true, failure);
  if (!errors) return {};
  return {errors->mean(true), errors->mean(false)};
}

Json number(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

}  // namespace

WeightsFit fit_weights(FitSetup setup, const LawState& before, const std::string& body,
                       int iterations, const Interrupter& interrupter,
                       std::vector<std::string>& statements, std::vector<Json>& history,
                       const std::function<void(const FitReport&)>& tell) {
  for (fit::SceneBuilder& builder : setup.builders) {
    builder = with_weights(std::move(builder), body);
  }
  const fit::Quantity& row = fit::row_named(fit::Owner::kBody, kRow);
  for (std::size_t i = 1; i < material::kIsotropicElastic; ++i) {
    fit::ParameterSpec weight;
    weight.where = "fit.weights";
    weight.path.quantity = &row;
    weight.path.owner = body;
    weight.path.index = i;
    setup.parameters.push_back(std::move(weight));
  }
  WeightsFit result;
  result.fit = std::make_unique<LawFit>(std::move(setup), interrupter, statements);
  LawFit& fit = *result.fit;
  fit.report = tell;
  std::vector<double> values = fit.start().values;
  std::copy(before.values.begin(), before.values.end(), values.begin());
  LawState state = fit.at_last_stage(std::move(values));
  const Means without = means_of(fit, state);
  const bool judged = without.held.has_value();
  Means best = without;
  int worse = 0;
  while (!state.finished && state.iterations < iterations && worse < kMostWorse) {
    const int known = state.iterations;
    fit.advance(state, history);
    if (state.iterations == known) continue;
    const Means now = means_of(fit, state);
    const bool nearer = judged ? now.held && *now.held < *best.held : now.seen.has_value();
    worse = nearer ? 0 : worse + 1;
    if (!nearer) continue;
    best = now;
    result.state = state;
    result.taken = true;
  }
  if (result.taken) {
    result.state.iterations = before.iterations + state.iterations;
    result.state.evaluations = before.evaluations + state.evaluations;
    result.state.converged = before.converged;
    result.state.reason = before.reason;
    result.state.statements = before.statements;
  }
  const auto both = [](const std::optional<double>& one, const std::optional<double>& other) {
    return Json{{"without", number(one)}, {"with", number(other)}};
  };
  result.report = {{"body", body},
                   {"taken", result.taken},
                   {"iterations", state.iterations},
                   {"evaluations", state.evaluations},
                   {"held_out_mm", both(without.held, best.held)},
                   {"fitted_mm", both(without.seen, best.seen)}};
  statements.push_back(
      result.taken
          ? fmt::format("{}: with all weights of its energy moved, what {} is missed by {:.3g} mm "
                        "in the mean, without by {:.3g}.{}",
                        body, judged ? "was held out" : "was fitted",
                        *(judged ? best.held : best.seen), *(judged ? without.held : without.seen),
                        judged ? " What was held out has chosen among the iterations." : "")
          : fmt::format("{}: moving all weights of its energy predicts no better than without; "
                        "they stay.",
                        body));
  return result;
}

void add_weight_lists(const fit::Parameters& parameters, Json& document) {
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const fit::Address& path = parameters.path(k);
    const bool code = path.quantity->path == "material.latent[#]";
    if (path.quantity->path != kRow && !code) continue;
    Json& material = (*find_named(document.at("scene"), "bodies", path.owner))["material"];
    if (code) {
      if (!material.contains("latent")) {
        material["latent"] = std::vector<double>(material::kLatentSize, 0.0);
      }
      continue;
    }
    if (material.contains("weight_moves")) continue;
    material["weight_moves"] = std::vector<double>(material::kIsotropicElastic, 0.0);
  }
}

std::string weights_file_name(const std::string& body) {
  return "weights_" + body + ".safetensors";
}

void write_weights(const material::Material& fitted, const std::string& body,
                   const std::filesystem::path& folder, Json& document) {
  const std::filesystem::path file = folder / weights_file_name(body);
  Tensors tensors = start_tensors(*moved_start(fitted, file.generic_string()));
  tensors.metadata = {{"law", "neural_isotropic"},
                      {"name", body + ", fitted"},
                      {"version", MATTERFIT_VERSION},
                      {"source", "matterfit fit"}};
  write_file(file, format_safetensors(tensors));
  Json& material = (*find_named(document.at("scene"), "bodies", body))["material"];
  material["weights"] = file.generic_string();
  material.erase("weight_moves");
}

}  // namespace matterfit::job
