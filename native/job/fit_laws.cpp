// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_laws.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "job/documents/neural_starts.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/pretrain.hpp"
#include "material/neural/published_material.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::job {
namespace {

using material::Law;
using material::Material;

const fit::Quantity& of_material(std::string_view key) {
  return fit::row_named(fit::Owner::kBody, std::string("material.").append(key));
}

/// The start law of the same class.
material::StartLaw start_of(const Material& material) {
  if (material.traits().fluid) return material::StartLaw::kWater;
  if (material.law == Law::kDruckerPrager) return material::StartLaw::kSand;
  return material.traits().plastic ? material::StartLaw::kPlasticine : material::StartLaw::kJelly;
}

/// The neural law with the moduli and the flow of a classical one, damped as it is.
Material as_neural(const Material& material) {
  const material::RestModuli moduli = material::rest_moduli(material);
  const auto start = neural_start(std::string(material::start_law_name(start_of(material))));
  material::IsotropicStart with_flow = *start;
  material::set_classical_flow(material, moduli.shear, with_flow.weights);
  Material result = isotropic_material(std::make_shared<material::IsotropicStart>(with_flow));
  result.start = start;
  result.youngs_modulus = 9.0 * moduli.bulk * moduli.shear / (3.0 * moduli.bulk + moduli.shear);
  result.poisson_ratio = std::clamp(
      (3.0 * moduli.bulk - 2.0 * moduli.shear) / (2.0 * (3.0 * moduli.bulk + moduli.shear)), -0.85,
      0.4998);
  result.damping_shear = material.damping_shear;
  result.damping_bulk = material.damping_bulk;
  result.maxwell = material.maxwell;
  result.correction = material.correction;
  return result;
}

/// The latent law at the place of a classical one, or of the class of the isotropic one.
Material as_latent(const Material& material) {
  Material result;
  result.damping_shear = material.damping_shear;
  result.damping_bulk = material.damping_bulk;
  result.maxwell = material.maxwell;
  result.correction = material.correction;
  const auto decoder = latent_preset();
  if (material.law == Law::kNeuralIsotropic) {
    set_latent(result, decoder, {});
    result.youngs_modulus = material.youngs_modulus;
    return result;
  }
  const material::LatentCode code = material::latent_code(*decoder, material);
  set_latent(result, decoder, std::span<const double>(code.data(), material::kLatentSize));
  // The same shear modulus at rest.
  result.youngs_modulus =
      2.0 * (1.0 + result.poisson_ratio) * material::rest_moduli(material).shear;
  return result;
}

/// Numbers of the neural law that are fitted where it is a candidate, and the parameter of the
/// document's law that each stands for: the form always.
constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kNeuralCandidates = {
    {{"form_1", ""},
     {"form_2", ""},
     {"yield_strain", "yield_stress"},
     {"internal_friction", "friction_angle"},
     {"flow_rate", "viscosity"}}};

bool tells_laws_apart(const fit::Quantity& row, Law own, Law law) {
  if (row.scanned) return true;
  if (law != Law::kNeuralIsotropic) return false;
  return std::any_of(kNeuralCandidates.begin(), kNeuralCandidates.end(), [&](const auto& pair) {
    return pair.first == row.key() &&
           (pair.second.empty() || material::traits(own).uses(pair.second));
  });
}

}  // namespace

Material with_law(const Material& material, Law law) {
  if (material.published && law != material.law) {  // of its moduli
    Material elastic = material;
    elastic.law = Law::kFixedCorotated;
    elastic.published.reset();
    elastic.weight_moves.clear();
    return with_law(elastic, law);
  }
  if (law == Law::kLatent && material.law != law) return as_latent(material);
  if (law == Law::kNeuralIsotropic && material.law != law) return as_neural(material);
  Material result = material;
  result.law = law;
  const auto is_new = [&](std::string_view key) {
    return material::traits(law).uses(key) && !material::traits(material.law).uses(key);
  };
  if (is_new("E")) {
    const double nu = fit::usual_start(of_material("nu"), result);
    result.poisson_ratio = nu;
    result.youngs_modulus = 3.0 * (1.0 - 2.0 * nu) * material.bulk_modulus;
  }
  if (is_new("bulk_modulus")) {
    result.bulk_modulus = material.youngs_modulus / (3.0 * (1.0 - 2.0 * material.poisson_ratio));
  }
  for (const char* key : {"yield_stress", "friction_angle", "viscosity"}) {
    const fit::Quantity& row = of_material(key);
    if (is_new(key)) result.*row.member = fit::usual_start(row, result);
  }
  return result;
}

std::vector<fit::ParameterSpec> parameters_of_law(const FitDoc& doc, Law own, Law law) {
  std::vector<fit::ParameterSpec> result;
  const fit::Quantity& latent = of_material("latent[#]");
  const auto is_of_law = [&](const fit::Address& path) {
    return path.owner == doc.body && path.quantity->of_law;
  };
  for (const fit::ParameterSpec& parameter : doc.parameters) {
    if (is_of_law(parameter.path) && !material::traits(law).uses(parameter.path.quantity->key())) {
      continue;
    }
    if (parameter.path.quantity == &latent && law != Law::kLatent) continue;
    result.push_back(parameter);
  }
  const auto add = [&](fit::ParameterSpec parameter) {
    const bool listed = std::any_of(result.begin(), result.end(), [&](const auto& other) {
      return other.path.text() == parameter.path.text();
    });
    if (!listed) result.push_back(std::move(parameter));
  };
  // What is scanned for tells one law from another; the rest is fitted on request.
  for (const std::string_view key : material::traits(law).parameters) {
    fit::ParameterSpec parameter;
    parameter.where = "fit.laws";
    parameter.path.quantity = &of_material(key);
    parameter.path.owner = doc.body;
    // Stresses of the latent law are in units of E, so that without it no code is found.
    const bool scale = law == Law::kLatent && key == "E";
    if (!scale && (material::traits(own).uses(key) ||
                   !tells_laws_apart(*parameter.path.quantity, own, law))) {
      continue;
    }
    add(std::move(parameter));
  }
  for (std::size_t i = 0; law == Law::kLatent && i < material::kLatentSize; ++i) {
    fit::ParameterSpec parameter;
    parameter.where = "fit.laws";
    parameter.path.quantity = &latent;
    parameter.path.owner = doc.body;
    parameter.path.index = i;
    add(std::move(parameter));
  }
  return result;
}

Json material_json(const Material& material) {
  Json json = {{"law", material::traits(material.law).name}};
  const bool latent = material.law == Law::kLatent;
  if (latent) {
    json["weights"] = material.decoder->name;
    json["latent"] = material.latent;
  } else if (material.published) {
    json["weights"] = material.published->name;
  } else if (material.start) {
    json["weights"] = material.start->name;
  }
  for (const fit::Quantity& row : fit::quantities()) {
    if (row.member == nullptr) continue;
    const double value = material.*row.member;
    if (row.of_law ? material.traits().uses(row.key()) : value > 0.0) {
      json[std::string(row.key())] = value;
    }
  }
  if (!latent && !material.weight_moves.empty()) json["weight_moves"] = material.weight_moves;
  for (const material::MaxwellBranch& branch : material.maxwell) {
    json["maxwell"].push_back({{"modulus", branch.modulus}, {"time", branch.time}});
  }
  if (!material.correction.empty()) json["correction"] = material.correction;
  return json;
}

}  // namespace matterfit::job
