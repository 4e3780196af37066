// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_laws.hpp"

#include <algorithm>
#include <array>
#include <string>

namespace matterfit::job {
namespace {

using material::Law;
using material::Material;

constexpr double kUsualPoissonRatio = 0.3;
constexpr double kUsualYieldStrain = 0.02;
constexpr double kUsualFrictionAngle = 30.0;  // [degrees]
constexpr double kUsualViscosity = 10.0;      // [Pa s]

/// What tells one law from another; the rest (hardening, exponent, cohesion) is fitted on request.
constexpr std::array<FitQuantity, 5> kTelling = {
    FitQuantity::kYoungsModulus, FitQuantity::kBulkModulus, FitQuantity::kYieldStress,
    FitQuantity::kViscosity, FitQuantity::kFrictionAngle};

}  // namespace

Material with_law(const Material& material, Law law) {
  Material result = material;
  result.law = law;
  const auto is_new = [&](std::string_view key) {
    return material::traits(law).uses(key) && !material::traits(material.law).uses(key);
  };
  if (is_new("E")) {
    result.poisson_ratio = kUsualPoissonRatio;
    result.youngs_modulus = 3.0 * (1.0 - 2.0 * kUsualPoissonRatio) * material.bulk_modulus;
  }
  if (is_new("bulk_modulus")) {
    result.bulk_modulus = material.youngs_modulus / (3.0 * (1.0 - 2.0 * material.poisson_ratio));
  }
  if (is_new("yield_stress")) result.yield_stress = kUsualYieldStrain * result.youngs_modulus;
  if (is_new("friction_angle")) result.friction_angle = kUsualFrictionAngle;
  if (is_new("viscosity")) result.viscosity = kUsualViscosity;
  return result;
}

std::vector<FitParameterDoc> parameters_of_law(const FitDoc& fit, Law own, Law law) {
  std::vector<FitParameterDoc> result;
  const auto is_of_law = [&](const FitPath& path) {
    return path.owner == fit.body && !path.law_parameter().empty();
  };
  for (const FitParameterDoc& parameter : fit.parameters) {
    if (is_of_law(parameter.path) && !material::traits(law).uses(parameter.path.law_parameter()))
      continue;
    result.push_back(parameter);
  }
  for (const FitQuantity quantity : kTelling) {
    FitParameterDoc parameter;
    parameter.where = "fit.laws";
    parameter.path.quantity = quantity;
    parameter.path.owner = fit.body;
    const std::string_view key = parameter.path.law_parameter();
    if (!material::traits(law).uses(key) || material::traits(own).uses(key)) continue;
    const bool listed = std::any_of(result.begin(), result.end(), [&](const auto& other) {
      return other.path.text() == parameter.path.text();
    });
    if (!listed) result.push_back(std::move(parameter));
  }
  return result;
}

Json material_json(const Material& material) {
  Json json = {{"law", material::traits(material.law).name}};
  const auto put = [&](const char* key, double value) {
    if (material::traits(material.law).uses(key)) json[key] = value;
  };
  put("E", material.youngs_modulus);
  put("nu", material.poisson_ratio);
  put("yield_stress", material.yield_stress);
  put("hardening", material.hardening);
  put("viscosity", material.viscosity);
  put("exponent", material.exponent);
  put("friction_angle", material.friction_angle);
  put("cohesion", material.cohesion);
  put("bulk_modulus", material.bulk_modulus);
  if (material.damping_shear > 0.0) json["damping_shear"] = material.damping_shear;
  if (material.damping_bulk > 0.0) json["damping_bulk"] = material.damping_bulk;
  for (const material::MaxwellBranch& branch : material.maxwell) {
    json["maxwell"].push_back({{"modulus", branch.modulus}, {"time", branch.time}});
  }
  return json;
}

}  // namespace matterfit::job
