// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/isotropic_material.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.hpp"

namespace matterfit::material {
namespace {

/// Least share of the shear modulus that κ and the volume units keep.
constexpr double kLeastVolume = 1e-3;

using Forms = std::array<double Material::*, kForms>;
constexpr Forms kFormMembers = {&Material::form_1, &Material::form_2, &Material::form_3,
                                &Material::form_4};

/// The energy's weights with a shear modulus of 1, moved along the directions.
IsotropicWeights formed_weights(const Material& m) {
  if (!m.start) {  // Hencky's energy alone
    IsotropicWeights weights = plain_isotropic(1.0, 1.0);
    constexpr double kSilent = -50.0;
    for (std::size_t k = 0; k < kShapeUnits; ++k) weights[2 + k] = kSilent;
    for (std::size_t k = 0; k < kVolumeUnits; ++k) weights[2 + 4 * kShapeUnits + k] = kSilent;
    return weights;
  }
  IsotropicWeights weights = m.start->weights;
  for (std::size_t k = 0; k < kForms; ++k) {
    for (std::size_t i = 0; i < kIsotropicElastic; ++i) {
      weights[i] += m.*kFormMembers[k] * m.start->directions[k][i];
    }
  }
  return weights;
}

/// Those, each moved by its own number.
IsotropicWeights moved_weights(const Material& m) {
  IsotropicWeights weights = formed_weights(m);
  for (std::size_t i = 0; i < std::min(kIsotropicElastic, m.weight_moves.size()); ++i) {
    weights[i] += m.weight_moves[i];
  }
  weights[0] = 0.0;
  return weights;
}

/// What scales the form to the material's moduli.
struct Scaling {
  double shear;  ///< G [Pa]
  double ratio;  ///< K/G
  RestStiffness rest;
  double mu;      ///< of all [Pa]
  double volume;  ///< of κ and the volume units, on top
  bool free;      ///< the bulk modulus is the material's
};

Scaling scaling(const Material& m, const IsotropicConstants<double>& relative) {
  Scaling s{};
  s.shear = m.youngs_modulus / (2.0 * (1.0 + m.poisson_ratio));
  s.ratio = (m.lambda() + 2.0 / 3.0 * s.shear) / s.shear;
  s.rest = rest_stiffness(relative);
  s.mu = s.shear / s.rest.shear;
  const double left = s.ratio * s.rest.shear - s.rest.bulk_by_shape;
  s.free = left > kLeastVolume;
  s.volume = std::max(left, kLeastVolume) / s.rest.bulk_by_volume;
  return s;
}

}  // namespace

IsotropicConstants<double> isotropic_constants(const Material& m) {
  IsotropicConstants<double> c = isotropic_constants<double>(moved_weights(m));
  const Scaling s = scaling(m, c);
  c.mu *= s.mu;
  c.kappa *= s.mu * s.volume;
  for (double& gain : c.shape_gain) gain *= s.mu;
  for (double& gain : c.volume_gain) gain *= s.mu * s.volume;
  c.yield = m.yield_strain;
  c.friction = m.internal_friction;
  c.hardening = m.strain_hardening;
  c.tension = m.tear_strain;
  c.rate = m.flow_rate;
  c.thinning = m.flow_thinning;
  return c;
}

ModuliGradient add_isotropic_gradient(const Material& m, const IsotropicConstants<double>& bar,
                                      MaterialGradient& gradient) {
  gradient.yield_strain += bar.yield;
  gradient.internal_friction += bar.friction;
  gradient.strain_hardening += bar.hardening;
  gradient.tear_strain += bar.tension;
  gradient.flow_rate += bar.rate;
  gradient.flow_thinning += bar.thinning;
  const IsotropicWeights weights = moved_weights(m);
  const auto relative = isotropic_constants<double>(weights);
  const Scaling s = scaling(m, relative);
  IsotropicConstants<double> own = bar;  // of the relative constants
  double of_all = bar.mu;
  double of_volume = relative.kappa * bar.kappa;
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    of_all += relative.shape_gain[k] * bar.shape_gain[k];
    own.shape_gain[k] *= s.mu;
  }
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    of_volume += relative.volume_gain[k] * bar.volume_gain[k];
    own.volume_gain[k] *= s.mu * s.volume;
  }
  own.mu = 0.0;
  own.kappa *= s.mu * s.volume;
  const double mu_bar = of_all + s.volume * of_volume;
  const double volume_bar = s.mu * of_volume;
  const double left_bar = s.free ? volume_bar / s.rest.bulk_by_volume : 0.0;
  RestStiffness rest_bar;
  rest_bar.shear = left_bar * s.ratio - mu_bar * s.mu / s.rest.shear;
  rest_bar.bulk_by_shape = -left_bar;
  rest_bar.bulk_by_volume = -volume_bar * s.volume / s.rest.bulk_by_volume;
  const double ratio_bar = left_bar * s.rest.shear;
  add_rest_stiffness_adjoint(relative, rest_bar, own);
  IsotropicWeights of_weights{};
  add_isotropic_weights_adjoint(weights, own, of_weights);
  gradient.weight_moves.assign(m.weight_moves.size(), 0.0);
  for (std::size_t i = 1; i < std::min(kIsotropicElastic, m.weight_moves.size()); ++i) {
    gradient.weight_moves[i] = of_weights[i];
  }
  if (m.start) {
    constexpr std::array<double MaterialGradient::*, kForms> kSlopes = {
        &MaterialGradient::form_1, &MaterialGradient::form_2, &MaterialGradient::form_3,
        &MaterialGradient::form_4};
    for (std::size_t k = 0; k < kForms; ++k) {
      for (std::size_t i = 1; i < kIsotropicElastic; ++i) {
        gradient.*kSlopes[k] += m.start->directions[k][i] * of_weights[i];
      }
    }
  }
  return {mu_bar / s.rest.shear - ratio_bar * s.ratio / s.shear, ratio_bar / s.shear};
}

Material isotropic_material(std::shared_ptr<const IsotropicStart> start) {
  const auto c = isotropic_constants<double>(start->weights);
  const RestStiffness rest = rest_stiffness(c);
  const double bulk = rest.bulk_by_shape + rest.bulk_by_volume;
  Material m;
  m.law = Law::kNeuralIsotropic;
  m.start = std::move(start);
  m.youngs_modulus = 9.0 * bulk * rest.shear / (3.0 * bulk + rest.shear);
  m.poisson_ratio = (3.0 * bulk - 2.0 * rest.shear) / (2.0 * (3.0 * bulk + rest.shear));
  // Files hold logarithms, which have no 0: 1e-6 stands for it.
  const auto or_none = [](double value) { return value < 1.1e-6 ? 0.0 : value; };
  m.yield_strain = or_none(c.yield);
  m.internal_friction = or_none(c.friction);
  m.strain_hardening = or_none(c.hardening);
  m.tear_strain = or_none(c.tension);
  m.flow_rate = c.rate;
  m.flow_thinning = or_none(c.thinning);
  return m;
}

FlowClass flow_class(const Material& m) {
  if (m.tear_strain < kNeverStrain) return FlowClass::kGranular;
  if (m.yield_strain >= kNeverStrain) return FlowClass::kElastic;
  const bool liquid = m.yield_strain < kLiquidStrain && m.internal_friction < kLiquidStrain;
  return liquid ? FlowClass::kLiquid : FlowClass::kPlastic;
}

Tensors start_tensors(const IsotropicStart& start) {
  Tensors out = isotropic_tensors(start.weights);
  Tensor& directions = out.tensors["directions"];
  directions.shape = {kForms, kIsotropicWeights};
  directions.values.reserve(kForms * kIsotropicWeights);
  for (const IsotropicWeights& direction : start.directions) {
    for (const double entry : direction) directions.values.push_back(static_cast<float>(entry));
  }
  return out;
}

std::shared_ptr<const IsotropicStart> moved_start(const Material& m, std::string name) {
  auto moved = std::make_shared<IsotropicStart>();
  if (m.start) *moved = *m.start;
  if (!m.start) moved->weights = formed_weights(m);
  moved->name = std::move(name);
  for (std::size_t i = 1; i < std::min(kIsotropicElastic, m.weight_moves.size()); ++i) {
    moved->weights[i] += m.weight_moves[i];
  }
  return moved;
}

std::shared_ptr<const IsotropicStart> isotropic_start(const Tensors& tensors,
                                                      const std::string& name) {
  auto start = std::make_shared<IsotropicStart>();
  start->name = name;
  start->weights = isotropic_weights(tensors, name);
  const auto found = tensors.tensors.find("directions");
  if (found == tensors.tensors.end() || found->second.values.size() != kForms * kIsotropicWeights) {
    throw_input(name + ": tensor 'directions' is missing or has not " + std::to_string(kForms) +
                " × " + std::to_string(kIsotropicWeights) +
                " numbers. Is it a file of the isotropic neural law?");
  }
  std::size_t at = 0;
  for (IsotropicWeights& direction : start->directions) {
    for (double& entry : direction) {
      entry = found->second.values[at++];
      if (!std::isfinite(entry)) {
        throw_input(name + ": number " + std::to_string(at - 1) +
                    " of tensor 'directions' is no number.");
      }
    }
  }
  return start;
}

}  // namespace matterfit::material
