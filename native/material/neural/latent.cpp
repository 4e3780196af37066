// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/latent.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/pretrain.hpp"

namespace matterfit::material {
namespace {

constexpr auto kCode = static_cast<Eigen::Index>(kLatentSize);
constexpr auto kHidden = static_cast<Eigen::Index>(kLatentHidden);
constexpr auto kOutputs = static_cast<Eigen::Index>(kLatentOutputs);
constexpr auto kFeatures = static_cast<Eigen::Index>(kLatentFeatures);
constexpr auto kClasses = static_cast<Eigen::Index>(kLatentClasses.size());

LatentCode code_of(const Material& m) { return Eigen::Map<const LatentCode>(m.latent.data()); }

/// The flow's numbers in the order of the bounded outputs, the limits first.
constexpr std::array<double Material::*, kIsotropicFlow> kFlow = {
    &Material::yield_strain, &Material::internal_friction, &Material::strain_hardening,
    &Material::tear_strain,  &Material::flow_rate,         &Material::flow_thinning};
constexpr std::array<double MaterialGradient::*, kIsotropicFlow> kFlowSlopes = {
    &MaterialGradient::yield_strain,     &MaterialGradient::internal_friction,
    &MaterialGradient::strain_hardening, &MaterialGradient::tear_strain,
    &MaterialGradient::flow_rate,        &MaterialGradient::flow_thinning};

bool is_limit(std::size_t flow) {
  return kFlow[flow] == &Material::yield_strain || kFlow[flow] == &Material::tear_strain;
}

double poisson(double ratio) { return (3.0 * ratio - 2.0) / (2.0 * (3.0 * ratio + 1.0)); }
/// The derivative of poisson() by ln K/G.
double poisson_slope(double ratio) {
  const double below = 3.0 * ratio + 1.0;
  return 4.5 * ratio / (below * below);
}

/// Where a decoder's tensors lie: one list for reading and for writing.
template <class Decoder, class Visit>
void for_each_tensor(Decoder& d, const Visit& visit) {
  visit("decoder.first", d.first, kHidden, kCode);
  visit("decoder.first_offset", d.first_offset, kHidden, Eigen::Index{1});
  visit("decoder.second", d.second, kHidden, kHidden);
  visit("decoder.second_offset", d.second_offset, kHidden, Eigen::Index{1});
  visit("decoder.third", d.third, kOutputs, kHidden);
  visit("decoder.skip", d.skip, kOutputs, kCode);
  visit("decoder.output", d.output, kOutputs, Eigen::Index{1});
  visit("encoder.matrix", d.encoder, kCode, kFeatures);
  visit("encoder.offset", d.encoder_offset, kCode, Eigen::Index{1});
  visit("classes", d.classes, kClasses, kCode);
  visit("spreads", d.spreads, kClasses, kCode);
}

}  // namespace

LatentPass latent_pass(const LatentDecoder& d, const LatentCode& code) {
  LatentPass pass;
  pass.one = (d.first * code + d.first_offset).array().tanh();
  pass.two = (d.second * pass.one + d.second_offset).array().tanh();
  pass.output = d.output + d.skip * code + d.third * pass.two;
  return pass;
}

LatentOutput latent_output(const LatentDecoder& d, const LatentCode& code,
                           Eigen::MatrixXd* jacobian) {
  const auto [one, two, output] = latent_pass(d, code);
  if (jacobian != nullptr) {
    const Eigen::VectorXd one_slope = 1.0 - one.array().square();
    const Eigen::VectorXd two_slope = 1.0 - two.array().square();
    *jacobian = d.third * (two_slope.asDiagonal() *
                           (d.second * (one_slope.asDiagonal() * d.first).eval()).eval())
                              .eval() +
                d.skip;
  }
  return output;
}

BoundedOutput bounded_output(std::size_t k, double x) {
  const LatentBound& bound = kLatentBounds[k];
  const double low = std::log(bound.low);
  const double range = std::log(bound.high) - low;
  const double share = 1.0 / (1.0 + std::exp(-x));
  return {std::exp(low + range * share), range * share * (1.0 - share)};
}

void set_latent(Material& material, std::shared_ptr<const LatentDecoder> decoder,
                std::span<const double> code) {
  material.law = Law::kLatent;
  material.decoder = std::move(decoder);
  material.latent.assign(code.begin(), code.end());
  if (code.empty()) {
    const Eigen::VectorXd elastic = material.decoder->classes.row(0);
    material.latent.assign(elastic.begin(), elastic.end());
  }
  decode_latent(material);
}

void set_decoded(Material& m, const LatentOutput& x, const std::string& name) {
  auto start = std::make_shared<IsotropicStart>();
  start->name = name;
  for (std::size_t i = 1; i < kIsotropicElastic; ++i) {
    start->weights[i] = x[static_cast<Eigen::Index>(i - 1)];
  }
  m.start = std::move(start);
  m.weight_moves.assign(kIsotropicElastic, 0.0);
  const auto bounded = [&](std::size_t k) {
    return bounded_output(k, x[static_cast<Eigen::Index>(kLatentWeights + k)]).value;
  };
  m.poisson_ratio = poisson(bounded(0));
  for (std::size_t k = 0; k < kIsotropicFlow; ++k) m.*kFlow[k] = bounded(1 + k);
}

void decode_latent(Material& m) {
  if (!m.decoder || m.latent.size() != kLatentSize) {
    throw_compute("a code of the latent law has " + std::to_string(m.latent.size()) +
                  " numbers, expected " + std::to_string(kLatentSize) + ".");
  }
  set_decoded(m, latent_output(*m.decoder, code_of(m)), m.decoder->name);
  m.form_1 = m.form_2 = m.form_3 = m.form_4 = 0.0;
  for (std::size_t k = 0; k < kIsotropicFlow; ++k) {
    if (is_limit(k) && m.*kFlow[k] >= kLatentNever) m.*kFlow[k] = 10.0 * kNeverStrain;
  }
}

std::vector<double> latent_gradient(const Material& m, const MaterialGradient& of_decoded) {
  Eigen::MatrixXd jacobian;
  const LatentOutput x = latent_output(*m.decoder, code_of(m), &jacobian);
  LatentOutput bar = LatentOutput::Zero();
  for (std::size_t i = 1; i < kIsotropicElastic; ++i) {
    bar[static_cast<Eigen::Index>(i - 1)] = of_decoded.weight_moves[i];
  }
  for (std::size_t k = 0; k < kLatentBounded; ++k) {
    const auto at = static_cast<Eigen::Index>(kLatentWeights + k);
    const BoundedOutput output = bounded_output(k, x[at]);
    if (k == 0) {
      bar[at] = of_decoded.poisson_ratio * poisson_slope(output.value) * output.slope;
    } else if (!is_limit(k - 1) || output.value < kLatentNever) {
      bar[at] = of_decoded.*kFlowSlopes[k - 1] * output.value * output.slope;
    }
  }
  const Eigen::VectorXd of_code = jacobian.transpose() * bar;
  return {of_code.begin(), of_code.end()};
}

Eigen::VectorXd latent_features(const Material& classical) {
  const RestModuli moduli = rest_moduli(classical);
  IsotropicWeights flow{};
  set_classical_flow(classical, moduli.shear, flow);
  // The range that can be felt: strains from a millionth of a strain to one.
  const auto strain = [&](std::size_t weight) {
    return std::clamp(flow[weight] + 4.0, -5.0, 5.0) / 4.0;
  };
  Eigen::VectorXd f(kFeatures);
  f << (std::log(moduli.bulk / moduli.shear) - 1.0) / 2.0,
      classical.law == Law::kFixedCorotated ? 1.0 : 0.0,
      classical.law == Law::kNeoHookean ? 1.0 : 0.0, strain(kYieldWeight),
      2.0 * std::exp(std::min(flow[kFrictionWeight], 1.0)), strain(kHardeningWeight),
      strain(kTensionWeight), (std::min(flow[kRateWeight], std::log(1e8)) - 9.0) / 6.0,
      classical.law == Law::kHerschelBulkley
          ? 4.0 * (1.0 - std::clamp(classical.exponent, 0.5, 1.5))
          : 0.0;
  return f;
}

LatentCode latent_code(const LatentDecoder& decoder, const Material& classical) {
  constexpr double kFar = 4.0;
  const LatentCode code = decoder.encoder * latent_features(classical) + decoder.encoder_offset;
  return code.cwiseMax(-kFar).cwiseMin(kFar);
}

Tensors latent_tensors(const LatentDecoder& decoder) {
  Tensors out;
  for_each_tensor(decoder,
                  [&](const char* name, const auto& from, Eigen::Index rows, Eigen::Index columns) {
                    Tensor& tensor = out.tensors[name];
                    tensor.shape = {static_cast<std::size_t>(rows)};
                    if (columns > 1) tensor.shape.push_back(static_cast<std::size_t>(columns));
                    for (Eigen::Index r = 0; r < rows; ++r) {
                      for (Eigen::Index c = 0; c < columns; ++c) {
                        tensor.values.push_back(static_cast<float>(from(r, c)));
                      }
                    }
                  });
  return out;
}

std::shared_ptr<const LatentDecoder> latent_decoder(const Tensors& tensors,
                                                    const std::string& name) {
  auto decoder = std::make_shared<LatentDecoder>();
  decoder->name = name;
  for_each_tensor(
      *decoder, [&](const char* key, auto& into, Eigen::Index rows, Eigen::Index columns) {
        const auto found = tensors.tensors.find(key);
        const auto size = static_cast<std::size_t>(rows * columns);
        if (found == tensors.tensors.end() || found->second.values.size() != size) {
          throw_input(name + ": tensor '" + key + "' is missing or has not " +
                      std::to_string(rows) + " × " + std::to_string(columns) +
                      " numbers. Is it a file of the latent law, as 'matterfit pretrain --latent' "
                      "writes it?");
        }
        into.resize(rows, columns);
        for (Eigen::Index r = 0; r < rows; ++r) {
          for (Eigen::Index c = 0; c < columns; ++c) {
            into(r, c) = found->second.values[static_cast<std::size_t>(r * columns + c)];
            if (!std::isfinite(into(r, c))) {
              throw_input(name + ": number " + std::to_string(r * columns + c) + " of tensor '" +
                          key + "' is no number.");
            }
          }
        }
      });
  return decoder;
}

}  // namespace matterfit::material
