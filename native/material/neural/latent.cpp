// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/latent.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "material/neural/latent_network.hpp"
#include "material/neural/pretrain.hpp"

namespace matterfit::material {
namespace {

/// Constants of the flow below this have no effect; their logarithm stays finite.
constexpr double kNone = 1e-6;

}  // namespace

const std::array<LatentRange, kLatentNumbers>& latent_ranges() {
  static const std::array<LatentRange, kLatentNumbers> kRanges{{
      {"modulus", std::log(50.0), std::log(1e7)},
      {"volume", std::log(0.6), std::log(1200.0)},
      {"curve", -2.5, 1.5},
      {"yield", std::log(kNone), std::log(1e3)},
      {"friction", std::log(kNone), std::log(5.0)},
      {"rate", std::log(1e-3), std::log(1e9)},
      {"tension", std::log(kNone), std::log(1e3)},
      {"hardening", std::log(kNone), std::log(10.0)},
  }};
  return kRanges;
}

Latent latent_of(const Material& material) {
  const LawTraits& traits = material.traits();
  const RestModuli moduli = rest_moduli(material);
  // The flow's constants are strains of a law with these moduli.
  IsotropicWeights flow = plain_isotropic(moduli.shear, moduli.bulk);
  set_classical_flow(material, moduli.shear, flow);
  Latent z;
  z[kLatentModulus] = std::log(moduli.shear);
  z[kLatentVolume] = std::log(moduli.bulk / moduli.shear);
  switch (traits.family) {
    case StressFamily::kFixedCorotated:
      z[kLatentCurve] = 1.5;
      break;
    case StressFamily::kNeoHookean:
      z[kLatentCurve] = 1.0;
      break;
    case StressFamily::kNewtonian:
      z[kLatentCurve] = -2.5;
      break;
    default:
      z[kLatentCurve] = 0.0;
      break;
  }
  z[kLatentYield] = flow[kYieldWeight];
  z[kLatentFriction] = flow[kFrictionWeight];
  z[kLatentRate] = flow[kRateWeight];
  z[kLatentTension] = flow[kTensionWeight];
  z[kLatentHardening] = flow[kHardeningWeight];
  return z;
}

void check_latent_network(const LatentNetwork& network, const std::string& name) {
  if (network.size() != kLatentWeights ||
      !std::all_of(network.begin(), network.end(), [](double w) { return std::isfinite(w); })) {
    throw_input(name + ": the latent law's network must have " + std::to_string(kLatentWeights) +
                " finite weights; this one has " + std::to_string(network.size()) + ".");
  }
}

IsotropicWeights latent_weights(const LatentNetwork& network, const Latent& latent) {
  check_latent_network(network, "latent_weights");
  const LatentOutput output = latent_output(network, latent[kLatentVolume], latent[kLatentCurve]);
  IsotropicWeights w{};
  for (std::size_t k = 0; k < kIsotropicElastic; ++k) w[k] = output.values[k];
  w[0] += latent[kLatentModulus];
  w[kYieldWeight] = latent[kLatentYield];
  w[kFrictionWeight] = latent[kLatentFriction];
  w[kRateWeight] = latent[kLatentRate];
  w[kTensionWeight] = latent[kLatentTension];
  w[kHardeningWeight] = latent[kLatentHardening];
  w[kThinningWeight] = std::log(kNone);
  return w;
}

void add_latent_adjoint(const LatentNetwork& network, const Latent& latent,
                        const IsotropicWeights& weights_bar, Latent& latent_bar) {
  check_latent_network(network, "add_latent_adjoint");
  const LatentOutput output = latent_output(network, latent[kLatentVolume], latent[kLatentCurve]);
  latent_bar[kLatentModulus] += weights_bar[0];
  for (std::size_t k = 0; k < kIsotropicElastic; ++k) {
    latent_bar[kLatentVolume] += weights_bar[k] * output.by_volume[k];
    latent_bar[kLatentCurve] += weights_bar[k] * output.by_curve[k];
  }
  latent_bar[kLatentYield] += weights_bar[kYieldWeight];
  latent_bar[kLatentFriction] += weights_bar[kFrictionWeight];
  latent_bar[kLatentRate] += weights_bar[kRateWeight];
  latent_bar[kLatentTension] += weights_bar[kTensionWeight];
  latent_bar[kLatentHardening] += weights_bar[kHardeningWeight];
}

Tensors latent_tensors(const LatentNetwork& network) {
  check_latent_network(network, "latent_tensors");
  Tensors out;
  Tensor& tensor = out.tensors["latent_network"];
  tensor.shape = {kLatentWeights};
  tensor.values.reserve(kLatentWeights);
  for (const double weight : network) tensor.values.push_back(static_cast<float>(weight));
  return out;
}

LatentNetwork latent_network(const Tensors& tensors, const std::string& name) {
  const auto found = tensors.tensors.find("latent_network");
  if (found == tensors.tensors.end()) {
    throw_input(name + ": tensor 'latent_network' is missing. Is it a file of the latent law?");
  }
  LatentNetwork network(found->second.values.begin(), found->second.values.end());
  check_latent_network(network, name);
  return network;
}

}  // namespace matterfit::material
