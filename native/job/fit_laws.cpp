// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_laws.hpp"

#include <algorithm>
#include <string>

namespace matterfit::job {
namespace {

using material::Law;
using material::Material;

const fit::Quantity& of_material(std::string_view key) {
  return fit::row_named(fit::Owner::kBody, std::string("material.").append(key));
}

}  // namespace

Material with_law(const Material& material, Law law) {
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
  const auto is_of_law = [&](const fit::Address& path) {
    return path.owner == doc.body && path.quantity->of_law;
  };
  for (const fit::ParameterSpec& parameter : doc.parameters) {
    if (is_of_law(parameter.path) && !material::traits(law).uses(parameter.path.quantity->key())) {
      continue;
    }
    result.push_back(parameter);
  }
  // What is scanned for tells one law from another; the rest is fitted on request.
  for (const std::string_view key : material::traits(law).parameters) {
    fit::ParameterSpec parameter;
    parameter.where = "fit.laws";
    parameter.path.quantity = &of_material(key);
    parameter.path.owner = doc.body;
    if (!parameter.path.quantity->scanned || material::traits(own).uses(key)) continue;
    const bool listed = std::any_of(result.begin(), result.end(), [&](const auto& other) {
      return other.path.text() == parameter.path.text();
    });
    if (!listed) result.push_back(std::move(parameter));
  }
  return result;
}

Json material_json(const Material& material) {
  Json json = {{"law", material::traits(material.law).name}};
  for (const fit::Quantity& row : fit::quantities()) {
    if (row.member == nullptr) continue;
    const double value = material.*row.member;
    if (row.of_law ? material.traits().uses(row.key()) : value > 0.0) {
      json[std::string(row.key())] = value;
    }
  }
  for (const material::MaxwellBranch& branch : material.maxwell) {
    json["maxwell"].push_back({{"modulus", branch.modulus}, {"time", branch.time}});
  }
  return json;
}

}  // namespace matterfit::job
