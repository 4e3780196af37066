// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <cmath>
#include <utility>
#include <vector>

#include "material/neural/isotropic_material.hpp"
#include "material/neural/isotropic_principal.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::material {
namespace {

constexpr std::size_t kDirectionSamples = 400;
/// Stresses below this share of the stiffest modulus count as this.
constexpr double kSmallStressOfModulus = 0.01;
/// The logarithm of a gain moves by this much at most for a unit along a direction.
constexpr double kLargestMove = 3.0;

constexpr auto kFree = static_cast<Eigen::Index>(kIsotropicElastic);

/// Derivatives of the rest moduli by the weights.
Eigen::RowVectorXd rest_slope(const IsotropicWeights& weights, const RestStiffness& of) {
  const auto c = isotropic_constants<double>(weights);
  IsotropicConstants<double> c_bar{};
  add_rest_stiffness_adjoint(c, of, c_bar);
  IsotropicWeights bar{};
  add_isotropic_weights_adjoint(weights, c_bar, bar);
  return Eigen::Map<const Eigen::RowVectorXd>(bar.data(), kFree);
}

/// What a unit change of each weight does to weights whose moduli at rest are then restored by the
/// scale and by κ with the volume units, as isotropic_constants() does.
Eigen::MatrixXd restoring(const IsotropicWeights& weights) {
  const Eigen::RowVectorXd shear = rest_slope(weights, {1.0, 0.0, 0.0});
  const Eigen::RowVectorXd bulk = rest_slope(weights, {0.0, 1.0, 1.0});
  Eigen::MatrixXd compensate = Eigen::MatrixXd::Zero(kFree, 2);
  compensate(0, 0) = 1.0;
  compensate(1, 1) = 1.0;
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    compensate(static_cast<Eigen::Index>(2 + 4 * kShapeUnits + k), 1) = 1.0;
  }
  Eigen::MatrixXd both(2, kFree);
  both << shear, bulk;
  const Eigen::Matrix2d by = both * compensate;
  return Eigen::MatrixXd::Identity(kFree, kFree) - compensate * by.partialPivLu().solve(both);
}

}  // namespace

std::shared_ptr<const IsotropicStart> with_directions(std::string name,
                                                      const IsotropicWeights& weights,
                                                      std::uint64_t seed) {
  auto start = std::make_shared<IsotropicStart>();
  start->name = std::move(name);
  start->weights = weights;
  const double modulus = longest_wave_modulus(isotropic_constants<double>(weights));
  Random random(seed);
  Material strained;  // for its strains alone
  strained.law = Law::kStvkHencky;
  const std::vector<PrincipalSample> samples = elastic_samples(strained, kDirectionSamples, random);
  Eigen::MatrixXd jacobian(static_cast<Eigen::Index>(3 * kDirectionSamples), kFree);
  Eigen::Index row = 0;
  for (const PrincipalSample& sample : samples) {
    const PrincipalResponse at = principal_response(weights, sample.trial);
    const double scale = 1.0 / ((at.tau.norm() + kSmallStressOfModulus * modulus) *
                                std::sqrt(static_cast<double>(kDirectionSamples)));
    for (int i = 0; i < 3; ++i) jacobian.row(row++) = scale * at.by_weights.row(i);
  }
  const Eigen::MatrixXd restore = restoring(weights);
  // The gains alone: how much of the stiffness each unit has in its range of strains. A move of the
  // others would shift the ranges, which is no straight line to the stress.
  Eigen::MatrixXd effect = jacobian * restore;
  for (Eigen::Index k = 0; k < kFree; ++k) {
    if (!is_gain_weight(static_cast<std::size_t>(k))) effect.col(k).setZero();
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(effect, Eigen::ComputeThinV);
  for (std::size_t k = 0; k < kForms; ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    const Eigen::VectorXd along = svd.matrixV().col(column);
    const double size =
        std::max(svd.singularValues()[column], along.cwiseAbs().maxCoeff() / kLargestMove);
    Eigen::VectorXd direction = along / size;
    // Its sign: the largest entry is positive.
    Eigen::Index largest = 0;
    direction.cwiseAbs().maxCoeff(&largest);
    if (direction[largest] < 0.0) direction = -direction;
    for (Eigen::Index i = 1; i < kFree; ++i) {
      start->directions[k][static_cast<std::size_t>(i)] = direction[i];
    }
  }
  return start;
}

}  // namespace matterfit::material
