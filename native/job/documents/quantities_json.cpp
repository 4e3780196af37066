// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/quantities_json.hpp"

#include <fmt/format.h>

#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "effects/catalogue.hpp"
#include "fit/model/quantity.hpp"
#include "material/law_table.hpp"
#include "material/material.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/pretrain.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::job {
namespace {

using fit::Coordinate;
using fit::Owner;

std::string_view owner_name(Owner owner) {
  switch (owner) {
    case Owner::kBody:
      return "body";
    case Owner::kCollider:
      return "collider";
    case Owner::kScene:
      return "scene";
    case Owner::kCapture:
      return "capture";
    case Owner::kEffect:
      return "effect";
  }
  return {};
}

std::string_view coordinate_name(Coordinate coordinate) {
  switch (coordinate) {
    case Coordinate::kLinear:
      return "linear";
    case Coordinate::kLog:
      return "log";
    case Coordinate::kLogit:
      return "logit";
  }
  return {};
}

Json row_json(const fit::Quantity& row) {
  const bool bounded = row.low != 0.0 || row.high != 0.0;
  return {{"path", row.path},
          {"owner", owner_name(row.owner)},
          {"list", fit::list_of(row.owner)},
          {"size", row.size},
          {"unit", row.unit},
          {"coordinate", coordinate_name(row.coordinate)},
          {"scale", row.scale_is_separation ? Json() : Json(row.scale)},
          {"bounds", bounded ? Json{row.low, row.high} : Json()},
          {"around", row.around},
          {"prior_sigma", row.prior_sigma},
          {"usual", {row.usual.of_modulus, row.usual.value}},
          {"stiffness", row.stiffness},
          {"of_law", row.of_law},
          {"gradient", static_cast<bool>(row.access.slope)},
          {"label", row.label},
          {"sentence", row.sentence}};
}

Json effect_json(const effects::EffectType& row) {
  Json parameters = Json::array();
  for (const effects::EffectParameter& parameter : row.parameters) {
    parameters.push_back({{"key", parameter.key},
                          {"unit", parameter.unit},
                          {"size", parameter.size},
                          {"bounds", {parameter.low, parameter.high}},
                          {"keyed", parameter.may_be_keyed}});
  }
  return {{"name", row.name}, {"parameters", parameters}};
}

/// Weights that the library carries, with the numbers of the isotropic neural law that they were
/// regressed to, in four figures.
Json start_json(material::StartLaw law) {
  const material::Material classical = material::start_material(law);
  const material::RestModuli moduli = material::rest_moduli(classical);
  auto wanted = std::make_shared<material::IsotropicStart>();
  wanted->weights = material::plain_isotropic(moduli.shear, moduli.bulk);
  material::set_classical_flow(classical, moduli.shear, wanted->weights);
  material::Material start = material::isotropic_material(std::move(wanted));
  // Units that are silent, but ready to learn, add a percent to plain weights.
  const double sum = 3.0 * moduli.bulk + moduli.shear;
  start.youngs_modulus = 9.0 * moduli.bulk * moduli.shear / sum;
  start.poisson_ratio = (1.5 * moduli.bulk - moduli.shear) / sum;
  Json numbers = Json::object();
  for (const fit::Quantity& row : fit::quantities()) {
    if (row.member == nullptr || !start.traits().uses(row.key())) continue;
    numbers[std::string(row.key())] = std::stod(fmt::format("{:.4g}", start.*row.member));
  }
  return {{"name", material::start_law_name(law)}, {"numbers", numbers}};
}

}  // namespace

Json quantities_json() {
  Json rows = Json::array();
  for (const fit::Quantity& row : fit::quantities()) rows.push_back(row_json(row));
  Json laws = Json::array();
  for (const material::LawTraits& law : material::all_laws()) {
    Json parameters = Json::array();
    for (const std::string_view key : law.parameters) parameters.push_back(key);
    laws.push_back({{"name", law.name},
                    {"label", law.label},
                    {"parameters", parameters},
                    {"flows", law.flows}});
  }
  Json starts = Json::array();
  for (const material::StartLaw law : material::kStartLaws) starts.push_back(start_json(law));
  Json effects = Json::array();
  for (const effects::EffectType* row : effects::catalogue()) {
    if (row->way == effects::Way::kTerm) effects.push_back(effect_json(*row));
  }
  return {{"quantities", rows},
          {"laws", laws},
          {"starts", starts},
          {"effects", effects},
          {"usual_factor", fit::kUsualFactor},
          {"never_strain", material::kNeverStrain},
          {"liquid_strain", material::kLiquidStrain},
          {"most_branches", material::kMostMaxwellBranches}};
}

}  // namespace matterfit::job
