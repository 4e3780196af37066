// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/tensors.hpp"
#include "material/classical/law_gradient.hpp"
#include "material/material.hpp"
#include "material/neural/isotropic_weights.hpp"

/// The latent law: one space of materials, a code of kLatentSize numbers each, in which elastic,
/// plastic, granular, pasty and liquid ones are places. A decoder, a small net, makes of a code
/// what the isotropic law takes (isotropic_material.hpp) but for Young's modulus, which stays a
/// number of its own: all stresses scale with it. The kernels know nothing of codes: the decoder
/// runs when a code is set, and a gradient by the code is that by the isotropic law's numbers times
/// the decoder's Jacobian.
namespace matterfit::material {

inline constexpr std::size_t kLatentSize = 8;
/// Numbers of a code are within; those of the materials it was trained on are about standard
/// normal.
inline constexpr double kFarthestCode = 6.0;

/// What the decoder puts out: the energy's weights but for the first, a scale; ln K/G; and the
/// logarithms of the flow's six, in their order. The last seven go through a sigmoid between the
/// bounds of kLatentBounds.
inline constexpr std::size_t kLatentWeights = kIsotropicElastic - 1;
inline constexpr std::size_t kLatentBounded = 1 + kIsotropicFlow;
inline constexpr std::size_t kLatentOutputs = kLatentWeights + kLatentBounded;
struct LatentBound {
  double low;
  double high;
};
/// Bounds of K/G, yield and friction, hardening, tension, rate [1/s] and thinning [1/s].
inline constexpr std::array<LatentBound, kLatentBounded> kLatentBounds{{{0.5, 4000.0},
                                                                        {1e-6, 1e3},
                                                                        {1e-6, 10.0},
                                                                        {1e-6, 10.0},
                                                                        {1e-6, 1e3},
                                                                        {1e-2, 1e10},
                                                                        {1e-2, 1e10}}};
/// A limit of the flow from this strain on is never met, and the material one without it.
inline constexpr double kLatentNever = 3.0;

inline constexpr std::size_t kLatentHidden = 32;
/// What the encoder sees of a classical material (latent_features()).
inline constexpr std::size_t kLatentFeatures = 9;
/// Classes of flow, each with its place in the space.
inline constexpr std::array<std::string_view, 5> kLatentClasses{"elastic", "plastic", "paste",
                                                                "granular", "liquid"};

using LatentCode = Eigen::Matrix<double, static_cast<int>(kLatentSize), 1>;
using LatentOutput = Eigen::Matrix<double, static_cast<int>(kLatentOutputs), 1>;

/// x = output + skip · z + third · tanh(second · tanh(first · z + …) + …).
struct LatentDecoder {
  std::string name;       ///< as documents have it
  Eigen::MatrixXd first;  ///< [hidden, code]
  Eigen::VectorXd first_offset;
  Eigen::MatrixXd second;  ///< [hidden, hidden]
  Eigen::VectorXd second_offset;
  Eigen::MatrixXd third;   ///< [outputs, hidden]
  Eigen::MatrixXd skip;    ///< [outputs, code]
  Eigen::VectorXd output;  ///< [outputs]
  /// The place of a classical material: encoder · latent_features() + encoder_offset.
  Eigen::MatrixXd encoder;  ///< [code, features]
  Eigen::VectorXd encoder_offset;
  /// Mean of each class, and the standard deviation along its longest axis.
  Eigen::MatrixXd classes;  ///< [classes, code]
  Eigen::MatrixXd spreads;  ///< [classes, code]
};

/// The net at a code: its hidden layers and its raw outputs.
struct LatentPass {
  Eigen::VectorXd one;
  Eigen::VectorXd two;
  LatentOutput output;
};
[[nodiscard]] LatentPass latent_pass(const LatentDecoder& decoder, const LatentCode& code);
/// The net's raw outputs, and their derivatives by the code if `jacobian` [outputs, code] is not
/// null.
[[nodiscard]] LatentOutput latent_output(const LatentDecoder& decoder, const LatentCode& code,
                                         Eigen::MatrixXd* jacobian = nullptr);

/// A decoder's bounded output `k`: exp(ln low + (ln high − ln low) σ(x)), and d ln value/dx.
struct BoundedOutput {
  double value;
  double slope;
};
[[nodiscard]] BoundedOutput bounded_output(std::size_t k, double x);

/// Sets the energy, Poisson's ratio and the flow of the isotropic law that raw outputs stand for;
/// limits of the flow are taken as they are, also those that are never met.
void set_decoded(Material& material, const LatentOutput& output, const std::string& name);

/// Makes the material of the latent law with that code: sets its law, decoder and code and what
/// follows of them; E, damping and relaxation stay. An empty code: the mean of the elastic class.
/// Throws Error(kCompute) for a code of another length.
void set_latent(Material& material, std::shared_ptr<const LatentDecoder> decoder,
                std::span<const double> code);
/// The decoded members anew, after the code has been changed.
void decode_latent(Material& material);

/// Derivatives by the code, from those by what the decoder makes of it: Poisson's ratio, the
/// weights and the flow.
[[nodiscard]] std::vector<double> latent_gradient(const Material& material,
                                                  const MaterialGradient& of_decoded);

/// ln K/G, whether it is fixed corotated and neo-Hookean, and the flow's logarithms, each of the
/// size of one.
[[nodiscard]] Eigen::VectorXd latent_features(const Material& classical);
/// The code of a classical material. Numbers beyond the space's bounds are clamped to ±4.
[[nodiscard]] LatentCode latent_code(const LatentDecoder& decoder, const Material& classical);

/// A file of the latent law. The second throws Error(kInput) that names the tensor that is missing,
/// of another shape, or has what is no number.
[[nodiscard]] Tensors latent_tensors(const LatentDecoder& decoder);
[[nodiscard]] std::shared_ptr<const LatentDecoder> latent_decoder(const Tensors& tensors,
                                                                  const std::string& name);

}  // namespace matterfit::material
