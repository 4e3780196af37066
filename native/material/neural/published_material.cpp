// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/published_material.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "base/random.hpp"
#include "base/vec.hpp"
#include "material/neural/published_law.hpp"

namespace matterfit::material {
namespace {

/// Strain at rest: far above the rounding of double, far below where the stress bends.
constexpr double kAtRest = 1e-4;
constexpr std::size_t kShears = 64;
constexpr double kFarthestPull = 0.2;
constexpr int kPullSteps = 8;

/// τ of F = I + `strain`, the elastic net alone.
class ElasticNet {
 public:
  explicit ElasticNet(PublishedWeights weights) : weights_(std::move(weights)) {
    weights_.plastic.assign(kNetWeights, 0.0F);
  }
  [[nodiscard]] Mat3d operator()(const Mat3d& strain) const {
    Mat3d elastic;
    return published_point(weights_, kPublishedSubstep, Mat3d::Identity() + strain, elastic);
  }

 private:
  PublishedWeights weights_;
};

/// Along `strain` of size one, the mean of pull and push.
Mat3d slope_at_rest(const ElasticNet& net, const Mat3d& strain) {
  return (net(kAtRest * strain) - net(-kAtRest * strain)) / (2.0 * kAtRest);
}

double bulk_at_rest(const ElasticNet& net) {
  return slope_at_rest(net, Mat3d::Identity()).trace() / 9.0;
}

/// The mean G of τ:e = 2G e:e over random e without trace.
double shear_at_rest(const ElasticNet& net) {
  Random random(20);
  double work = 0.0;
  for (std::size_t i = 0; i < kShears; ++i) {
    Mat3d e;
    for (int k = 0; k < 9; ++k) e(k / 3, k % 3) = random.between(-1.0, 1.0);
    e = (e + e.transpose()).eval();
    e -= e.trace() / 3.0 * Mat3d::Identity();
    e.normalize();
    work += slope_at_rest(net, e).cwiseProduct(e).sum();
  }
  return 0.5 * work / double(kShears);
}

/// Over the axes, and the diagonals of a cube's faces and of the cube.
double steepest_pull(const ElasticNet& net) {
  double steepest = 0.0;
  for (int k = 14; k < 27; ++k) {
    const Vec3d n = Vec3i(k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1).cast<double>().normalized();
    const Mat3d pull = n * n.transpose();
    double before = 0.0;
    double at = 0.0;
    for (int step = -kPullSteps; step <= kPullSteps; ++step) {
      const double by = kFarthestPull * double(step) / double(kPullSteps);
      const double stress = n.dot(net(by * pull) * n);
      if (step > -kPullSteps) steepest = std::max(steepest, (stress - before) / (by - at));
      before = stress;
      at = by;
    }
  }
  return steepest;
}

}  // namespace

std::shared_ptr<const PublishedLaw> make_published_law(PublishedWeights weights, std::string name) {
  check_published_weights(weights, name.c_str());
  const ElasticNet net(weights);
  const double bulk = bulk_at_rest(net);
  const double shear = shear_at_rest(net);
  if (!(bulk > 0.0 && shear > 0.0 && std::isfinite(bulk) && std::isfinite(shear))) {
    throw_input(
        fmt::format("{}: these weights hold no body together: at rest their bulk modulus is {:.4g} "
                    "Pa and their shear modulus {:.4g} Pa. Give weights that were trained.",
                    name, bulk, shear));
  }
  auto law = std::make_shared<PublishedLaw>();
  law->name = std::move(name);
  law->weights = std::move(weights);
  // Within what a material may have.
  law->poisson_ratio =
      std::clamp((3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear)), -0.89, 0.4999);
  law->youngs_modulus = 2.0 * shear * (1.0 + law->poisson_ratio);
  law->wave_modulus = std::max(bulk + 4.0 / 3.0 * shear, steepest_pull(net));
  return law;
}

PublishedWeights moved_published(const Material& material) {
  PublishedWeights moved = material.published->weights;
  const std::size_t count =
      std::min(material.weight_moves.size(), material.published->directions.size());
  for (std::size_t k = 0; k < count; ++k) {
    const auto by = static_cast<float>(material.weight_moves[k]);
    if (by == 0.0F) continue;
    const std::vector<float>& along = material.published->directions[k];
    for (std::size_t i = 0; i < kNetWeights; ++i) {
      moved.elastic[i] += by * along[i];
      moved.plastic[i] += by * along[kNetWeights + i];
    }
  }
  return moved;
}

void settle_moves(Material& material) {
  const std::vector<double>& moves = material.weight_moves;
  if (std::all_of(moves.begin(), moves.end(), [](double by) { return by == 0.0; })) return;
  auto law = std::make_shared<PublishedLaw>(
      *make_published_law(moved_published(material), material.published->name));
  law->directions = material.published->directions;
  material.youngs_modulus = law->youngs_modulus;
  material.poisson_ratio = law->poisson_ratio;
  material.published = std::move(law);
  material.weight_moves.assign(moves.size(), 0.0);
}

Material published_material(std::shared_ptr<const PublishedLaw> law) {
  Material m;
  m.law = Law::kPublished;
  m.youngs_modulus = law->youngs_modulus;
  m.poisson_ratio = law->poisson_ratio;
  m.published = std::move(law);
  return m;
}

}  // namespace matterfit::material
