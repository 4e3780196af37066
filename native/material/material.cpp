// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/material.hpp"

#include <cmath>
#include <sstream>

#include "base/error.hpp"
#include "material/correction.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/published_material.hpp"

namespace matterfit::material {
namespace {

void require(bool ok, const std::string& where, const char* name, double value, const char* range) {
  if (ok) return;
  std::ostringstream text;
  text << where << "." << name << " = " << value << " is outside " << range << ".";
  throw_input(text.str());
}

}  // namespace

double Material::mu() const {
  double modulus = 0.0;
  if (!traits().fluid) modulus = youngs_modulus / (2.0 * (1.0 + poisson_ratio));
  for (const MaxwellBranch& branch : maxwell) modulus += branch.modulus;
  return modulus;
}

double Material::lambda() const {
  if (traits().fluid) return bulk_modulus;
  return youngs_modulus * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio));
}

double Material::p_wave_modulus() const { return lambda() + 2.0 * mu(); }

double Material::stiffest_modulus() const {
  if (!is_isotropic(law) && !published) return p_wave_modulus();
  double relaxing = 0.0;
  for (const MaxwellBranch& branch : maxwell) relaxing += 2.0 * branch.modulus;
  if (published) return published->wave_modulus + relaxing;
  return usual_wave_modulus(isotropic_constants(*this)) + relaxing;
}

double Material::wave_speed(double rho) const { return std::sqrt(stiffest_modulus() / rho); }

const LawTraits& Material::traits() const {
  return is_isotropic(law) ? neural_traits(law, flow_class(*this)) : material::traits(law);
}

Law law_from_name(std::string_view name) {
  std::string known;
  for (const LawTraits& row : all_laws()) {
    if (row.name == name) return row.law;
    known += known.empty() ? "" : ", ";
    known += row.name;
  }
  throw_input("'" + std::string(name) + "' is not a law. Known laws: " + known + ".");
}

void validate(const Material& m, const std::string& where) {
  const LawTraits& law = m.traits();
  if (law.fluid) {
    require(m.bulk_modulus > 0 && m.bulk_modulus < 1e13, where, "bulk_modulus", m.bulk_modulus,
            "(0, 1e13) Pa");
  } else {
    require(m.youngs_modulus > 0 && m.youngs_modulus < 1e13, where, "E", m.youngs_modulus,
            "(0, 1e13) Pa");
    require(m.poisson_ratio > -0.9 && m.poisson_ratio <= 0.4999, where, "nu", m.poisson_ratio,
            "(-0.9, 0.4999]; 0.5 would need an infinite bulk modulus");
  }
  if (law.uses("yield_stress")) {
    require(m.yield_stress >= 0 && m.yield_stress < 1e13, where, "yield_stress", m.yield_stress,
            "[0, 1e13) Pa");
    require(m.hardening >= 0 && m.hardening < 1e13, where, "hardening", m.hardening,
            "[0, 1e13) Pa");
  }
  if (law.uses("yield_stress") || law.uses("exponent")) {
    require(m.exponent > 0.05 && m.exponent <= 5, where, "exponent", m.exponent, "(0.05, 5]");
  }
  require(m.viscosity >= 0 && m.viscosity < 1e9, where, "viscosity", m.viscosity, "[0, 1e9) Pa s");
  if (law.uses("friction_angle")) {
    require(m.friction_angle >= 0 && m.friction_angle < 80, where, "friction_angle",
            m.friction_angle, "[0, 80) degrees");
    require(m.cohesion >= 0 && m.cohesion < 1e12, where, "cohesion", m.cohesion, "[0, 1e12) Pa");
  }
  if (law.uses("yield_strain")) {
    const auto check_form = [&](const char* name, double value) {
      require(value >= -5 && value <= 5, where, name, value, "[-5, 5]");
    };
    check_form("form_1", m.form_1);
    check_form("form_2", m.form_2);
    check_form("form_3", m.form_3);
    check_form("form_4", m.form_4);
    require(m.yield_strain >= 0 && m.yield_strain < 1e9, where, "yield_strain", m.yield_strain,
            "[0, 1e9)");
    require(m.internal_friction >= 0 && m.internal_friction <= 100, where, "internal_friction",
            m.internal_friction, "[0, 100]");
    require(m.strain_hardening >= 0 && m.strain_hardening <= 1e3, where, "strain_hardening",
            m.strain_hardening, "[0, 1000]");
    require(m.tear_strain >= 0 && m.tear_strain < 1e9, where, "tear_strain", m.tear_strain,
            "[0, 1e9)");
    require(m.flow_rate > 0 && m.flow_rate <= 1e12, where, "flow_rate", m.flow_rate,
            "(0, 1e12] 1/s");
    if (!m.weight_moves.empty() && m.weight_moves.size() != kIsotropicElastic) {
      throw_input(where + ".weight_moves has " + std::to_string(m.weight_moves.size()) +
                  " numbers; the energy has " + std::to_string(kIsotropicElastic) +
                  " weights. Give one each, 0 for those that stay.");
    }
    for (const double move : m.weight_moves) {
      require(move >= -20 && move <= 20, where, "weight_moves", move, "[-20, 20]");
    }
    require(m.flow_thinning >= 0 && m.flow_thinning <= 1e12, where, "flow_thinning",
            m.flow_thinning, "[0, 1e12] 1/s");
  }
  if ((m.law == Law::kPublished) != (m.published != nullptr)) {
    throw_input(where + ": the law neural, and no other, has the weights of a file.");
  }
  if (m.law == Law::kLatent) {
    if (m.latent.size() != kLatentSize) {
      throw_input(where + ".latent has " + std::to_string(m.latent.size()) +
                  " numbers; a code has " + std::to_string(kLatentSize) + ".");
    }
    for (const double number : m.latent) {
      require(number >= -kFarthestCode && number <= kFarthestCode, where, "latent", number,
              "[-6, 6]; codes of known materials lie within 4");
    }
  }
  require(m.damping_shear >= 0 && m.damping_shear < 1e9, where, "damping_shear", m.damping_shear,
          "[0, 1e9) Pa s");
  require(m.damping_bulk >= 0 && m.damping_bulk < 1e9, where, "damping_bulk", m.damping_bulk,
          "[0, 1e9) Pa s");
  if (m.maxwell.size() > kMostMaxwellBranches) {
    throw_input(where + ".maxwell has " + std::to_string(m.maxwell.size()) + " branches; at most " +
                std::to_string(kMostMaxwellBranches) + " are simulated. Join those of like times.");
  }
  for (std::size_t i = 0; i < m.maxwell.size(); ++i) {
    const std::string branch = where + ".maxwell[" + std::to_string(i) + "]";
    require(m.maxwell[i].modulus >= 0 && m.maxwell[i].modulus < 1e13, branch, "modulus",
            m.maxwell[i].modulus, "[0, 1e13) Pa");
    require(m.maxwell[i].time > 0 && m.maxwell[i].time < 1e6, branch, "time", m.maxwell[i].time,
            "(0, 1e6) s");
  }
  check_correction(m.correction, where + ".correction");
}

}  // namespace matterfit::material
