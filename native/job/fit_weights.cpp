// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_weights.hpp"

#include <fmt/format.h>

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

constexpr const char* kRow = "material.weight_moves[#]";

}  // namespace

fit::SceneBuilder with_weight_moves(fit::SceneBuilder build, std::string body) {
  return [build = std::move(build), body = std::move(body)](double level, Arena& arena,
                                                            const Interrupter& interrupter) {
    mpm::Scene scene = build(level, arena, interrupter);
    std::vector<double>& moves = scene.bodies[fit::body_index(scene, body)].material.weight_moves;
    moves.resize(material::kIsotropicElastic, 0.0);
    return scene;
  };
}

FurtherFit fit_weights(FurtherStart from, const Interrupter& interrupter,
                       std::vector<std::string>& statements, std::vector<Json>& history) {
  const std::string body = from.body;
  for (fit::SceneBuilder& builder : from.setup.builders) {
    builder = with_weight_moves(std::move(builder), body);
  }
  FurtherFit result = go_on(std::move(from), weight_moves_of(body, 1, material::kIsotropicElastic),
                            0.0, interrupter, statements, history);
  result.key = "weights";
  add_weights_statement(body, "all weights of its energy", result, statements);
  return result;
}

void add_weights_statement(const std::string& body, const char* what, const FurtherFit& result,
                           std::vector<std::string>& statements) {
  const bool judged = result.report.at("held_out_mm").at("without").is_number();
  const Json& means = result.report.at(judged ? "held_out_mm" : "fitted_mm");
  statements.push_back(
      result.taken
          ? fmt::format("{}: with {} moved, what {} is missed by {:.3g} mm in the mean, "
                        "without by {:.3g}.{}",
                        body, what, judged ? "was held out" : "was fitted",
                        means.at("with").get<double>(), means.at("without").get<double>(),
                        judged ? " What was held out has chosen among the iterations." : "")
          : fmt::format("{}: moving {} predicts no better than without; they stay.", body, what));
}

std::string weights_file_name(const std::string& body) {
  return "weights_" + body + ".safetensors";
}

std::vector<fit::ParameterSpec> weight_moves_of(const std::string& body, std::size_t first,
                                                std::size_t end) {
  std::vector<fit::ParameterSpec> moves;
  for (std::size_t i = first; i < end; ++i) {
    fit::ParameterSpec move;
    move.where = "fit.weights";
    move.path.quantity = &fit::row_named(fit::Owner::kBody, kRow);
    move.path.owner = body;
    move.path.index = i;
    moves.push_back(std::move(move));
  }
  return moves;
}

Json& write_weights_file(Tensors weights, const char* law, const std::string& body,
                         const std::filesystem::path& folder, Json& document) {
  const std::filesystem::path file = folder / weights_file_name(body);
  weights.metadata = {{"law", law},
                      {"name", body + ", fitted"},
                      {"version", MATTERFIT_VERSION},
                      {"source", "matterfit fit"}};
  write_file(file, format_safetensors(weights));
  Json& material = (*find_named(document.at("scene"), "bodies", body))["material"];
  material["weights"] = file.generic_string();
  return material;
}

void write_weights(const material::Material& fitted, const std::string& body,
                   const std::filesystem::path& folder, Json& document) {
  const std::string name = (folder / weights_file_name(body)).generic_string();
  write_weights_file(start_tensors(*moved_start(fitted, name)), "neural_isotropic", body, folder,
                     document)
      .erase("weight_moves");
}

}  // namespace matterfit::job
