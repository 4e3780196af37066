// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/isotropic_weights.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace matterfit::material {
namespace {

enum class Meaning { kScale, kOfScale, kPlain, kTanh, kPositive };

constexpr Meaning meaning(std::size_t i) {
  if (i == 0) return Meaning::kScale;
  if (i < kShapeOwnWeight) return Meaning::kOfScale;
  if (i < kShapeOffsetWeight) return Meaning::kPlain;
  if (i < kVolumeGainWeight) return Meaning::kTanh;
  if (i < kVolumeTraceWeight) return Meaning::kOfScale;
  if (i < kVolumeOffsetWeight) return Meaning::kPlain;
  if (i < kIsotropicElastic) return Meaning::kTanh;
  return Meaning::kPositive;
}

double constant(const IsotropicWeights& weights, std::size_t i) {
  switch (meaning(i)) {
    case Meaning::kPlain:
      return weights[i];
    case Meaning::kTanh:
      return std::tanh(weights[i]);
    case Meaning::kOfScale:
      return std::exp(weights[0] + weights[i]);
    case Meaning::kScale:
    case Meaning::kPositive:
      break;
  }
  return std::exp(weights[i]);
}

}  // namespace

template <class S>
IsotropicConstants<S> isotropic_constants(const IsotropicWeights& weights) {
  IsotropicConstants<S> out;
  std::size_t i = 0;
  out.for_each([&](S& entry) { entry = static_cast<S>(constant(weights, i++)); });
  return out;
}
template IsotropicConstants<float> isotropic_constants(const IsotropicWeights&);
template IsotropicConstants<double> isotropic_constants(const IsotropicWeights&);

void add_isotropic_weights_adjoint(const IsotropicWeights& weights,
                                   IsotropicConstants<double> constants_bar,
                                   std::span<double, kIsotropicWeights> weights_bar) {
  std::size_t i = 0;
  constants_bar.for_each([&](double& bar) {
    const double value = constant(weights, i);
    switch (meaning(i)) {
      case Meaning::kPlain:
        weights_bar[i] += bar;
        break;
      case Meaning::kTanh:
        weights_bar[i] += bar * (1.0 - value * value);
        break;
      case Meaning::kOfScale:
        weights_bar[i] += bar * value;
        weights_bar[0] += bar * value;
        break;
      case Meaning::kScale:
      case Meaning::kPositive:
        weights_bar[i] += bar * value;
        break;
    }
    ++i;
  });
}

double longest_wave_modulus(const IsotropicConstants<double>& c) {
  double modulus = c.kappa + c.mu * 4.0 / 3.0;
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    const double own = c.shape_own[k] + c.shape_trace[k];
    modulus += c.shape_gain[k] * (own * own + 2.0 * c.shape_trace[k] * c.shape_trace[k]);
  }
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    modulus += c.volume_gain[k] * c.volume_trace[k] * c.volume_trace[k];
  }
  return modulus;
}

double usual_wave_modulus(const IsotropicConstants<double>& c) {
  constexpr int kSteps = 2;  // either side of rest
  // sech²(z + c) by tanh c.
  const auto bump = [](double z, double offset) {
    const double t = std::tanh(z);
    const double level = (t + offset) / (1.0 + t * offset);
    return 1.0 - level * level;
  };
  double largest = 0.0;
  for (int a = -kSteps; a <= kSteps; ++a) {
    for (int b = -kSteps; b <= kSteps; ++b) {
      for (int d = b; d <= kSteps; ++d) {
        const double strain[3] = {kWaveStrain * a / kSteps, kWaveStrain * b / kSteps,
                                  kWaveStrain * d / kSteps};
        const double theta = strain[0] + strain[1] + strain[2];
        double modulus = c.kappa + c.mu * 4.0 / 3.0;
        for (std::size_t k = 0; k < kShapeUnits; ++k) {
          const double trace = c.shape_trace[k];
          const double own = c.shape_own[k] + trace;
          for (int i = 0; i < 3; ++i) {
            const double slope = i == 0 ? own : trace;
            modulus += c.shape_gain[k] * slope * slope *
                       bump(c.shape_own[k] * strain[i] + trace * theta, c.shape_offset[k]);
          }
        }
        for (std::size_t k = 0; k < kVolumeUnits; ++k) {
          const double trace = c.volume_trace[k];
          modulus += c.volume_gain[k] * trace * trace * bump(trace * theta, c.volume_offset[k]);
        }
        largest = std::max(largest, modulus);
      }
    }
  }
  return largest;
}

RestStiffness rest_stiffness(const IsotropicConstants<double>& c) {
  RestStiffness out{c.mu, 0.0, c.kappa};
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    const double bend = c.shape_gain[k] * (1.0 - c.shape_offset[k] * c.shape_offset[k]);
    const double along = c.shape_own[k] / 3.0 + c.shape_trace[k];
    out.shear += 0.5 * bend * c.shape_own[k] * c.shape_own[k];
    out.bulk_by_shape += 3.0 * bend * along * along;
  }
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    const double bend = c.volume_gain[k] * (1.0 - c.volume_offset[k] * c.volume_offset[k]);
    out.bulk_by_volume += bend * c.volume_trace[k] * c.volume_trace[k];
  }
  return out;
}

void add_rest_stiffness_adjoint(const IsotropicConstants<double>& c, const RestStiffness& bar,
                                IsotropicConstants<double>& c_bar) {
  c_bar.mu += bar.shear;
  c_bar.kappa += bar.bulk_by_volume;
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    const double gain = c.shape_gain[k];
    const double slope = 1.0 - c.shape_offset[k] * c.shape_offset[k];
    const double own = c.shape_own[k];
    const double along = own / 3.0 + c.shape_trace[k];
    const double bend_bar = 0.5 * bar.shear * own * own + 3.0 * bar.bulk_by_shape * along * along;
    const double along_bar = 6.0 * bar.bulk_by_shape * gain * slope * along;
    c_bar.shape_gain[k] += bend_bar * slope;
    c_bar.shape_offset[k] -= 2.0 * bend_bar * gain * c.shape_offset[k];
    c_bar.shape_own[k] += bar.shear * gain * slope * own + along_bar / 3.0;
    c_bar.shape_trace[k] += along_bar;
  }
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    const double gain = c.volume_gain[k];
    const double slope = 1.0 - c.volume_offset[k] * c.volume_offset[k];
    const double trace = c.volume_trace[k];
    c_bar.volume_gain[k] += bar.bulk_by_volume * slope * trace * trace;
    c_bar.volume_offset[k] -= 2.0 * bar.bulk_by_volume * gain * c.volume_offset[k] * trace * trace;
    c_bar.volume_trace[k] += 2.0 * bar.bulk_by_volume * gain * slope * trace;
  }
}

double rest_shear_modulus(const IsotropicWeights& weights) {
  return rest_stiffness(isotropic_constants<double>(weights)).shear;
}

IsotropicWeights plain_isotropic(double shear_modulus, double bulk_modulus) {
  if (!(shear_modulus > 0.0) || !(bulk_modulus > 0.0)) {
    throw_input("plain_isotropic: moduli must be > 0 Pa.");
  }
  IsotropicWeights w{};
  w[0] = std::log(shear_modulus);
  w[1] = std::log(bulk_modulus / shear_modulus);
  // Units at both sides of rest, on a stretch alone and on a stretch less its share of the volume.
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    w[kShapeGainWeight + k] = -6.0;
    w[kShapeOwnWeight + k] = k % 2 == 0 ? 2.0 : 3.0;
    w[kShapeTraceWeight + k] = k < kShapeUnits / 2 ? 0.0 : -0.5;
    w[kShapeOffsetWeight + k] = k % 2 == 0 ? -1.0 : 1.0;
  }
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    const double side = 2.0 * static_cast<double>(k) / (kVolumeUnits - 1) - 1.0;
    w[kVolumeGainWeight + k] = -6.0;
    w[kVolumeTraceWeight + k] = 2.0;
    w[kVolumeOffsetWeight + k] = 1.2 * side;
  }
  w[kYieldWeight] = std::log(1e3);
  w[kFrictionWeight] = std::log(1e-6);
  w[kHardeningWeight] = std::log(1e-6);
  w[kTensionWeight] = std::log(1e3);
  w[kRateWeight] = std::log(1e9);
  w[kThinningWeight] = std::log(1e-6);
  return w;
}

Tensors isotropic_tensors(const IsotropicWeights& weights) {
  Tensors out;
  Tensor& tensor = out.tensors["isotropic"];
  tensor.shape = {kIsotropicWeights};
  tensor.values.reserve(kIsotropicWeights);
  for (const double weight : weights) tensor.values.push_back(static_cast<float>(weight));
  return out;
}

IsotropicWeights isotropic_weights(const Tensors& tensors, const std::string& name) {
  const auto found = tensors.tensors.find("isotropic");
  if (found == tensors.tensors.end() || found->second.values.size() != kIsotropicWeights) {
    throw_input(name + ": tensor 'isotropic' is missing or has not " +
                std::to_string(kIsotropicWeights) +
                " numbers. Is it a file of the isotropic neural law?");
  }
  IsotropicWeights out;
  for (std::size_t i = 0; i < kIsotropicWeights; ++i) {
    out[i] = found->second.values[i];
    if (!std::isfinite(out[i]))
      throw_input(name + ": weight " + std::to_string(i) + " is no number.");
  }
  return out;
}

}  // namespace matterfit::material
