// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_published_search.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "fit/data/follow.hpp"
#include "material/neural/published_law.hpp"

namespace matterfit::job {
namespace {

using material::kNetFeatures;
using material::kNetHidden;
using material::kNetOutputs;
using material::kNetWeights;
using material::PublishedLaw;
using material::PublishedWeights;

constexpr std::size_t kBothNets = 2 * kNetWeights;
constexpr std::size_t kFirstMatrix = kNetHidden * kNetFeatures;
constexpr std::size_t kLastMatrix = kFirstMatrix + kNetHidden * kNetHidden;

/// Steps in one set of directions.
constexpr int kStepsOfDirections = 3;
/// So many sets that end worse end the search.
constexpr int kMostWorseSets = 3;
/// Moves that are tried again.
constexpr std::size_t kMovesKept = 3;
/// One unit of a descent: root mean square of the weights' change in sizes of their matrices.
constexpr double kDescentUnit = 0.1;
/// A last matrix that is 0 (a law without flow) counts as one whose net gives about 1.
constexpr double kLeastSize = 0.1;

using Direction = std::vector<float>;

/// Adds factors as directions of the weights of the net that begins at `net`: of its stress or flow
/// without its mean over the diagonal, of that mean, and of the strains that it answers to. None
/// that are 0.
void add_factors(const std::vector<float>& weights, std::size_t net, std::vector<Direction>& out) {
  Direction shape(kBothNets, 0.0F);
  Direction volume(kBothNets, 0.0F);
  Direction strain(kBothNets, 0.0F);
  for (std::size_t i = 0; i < kFirstMatrix; ++i) strain[net + i] = weights[net + i];
  const std::size_t last = net + kLastMatrix;
  for (std::size_t h = 0; h < kNetHidden; ++h) {
    float mean = 0.0F;
    for (std::size_t k = 0; k < kNetOutputs; k += 4) mean += weights[last + k * kNetHidden + h];
    mean /= 3.0F;
    for (std::size_t k = 0; k < kNetOutputs; ++k) {
      const std::size_t at = last + k * kNetHidden + h;
      volume[at] = k % 4 == 0 ? mean : 0.0F;
      shape[at] = weights[at] - volume[at];
    }
  }
  const auto is_none = [](const Direction& d) {
    return std::all_of(d.begin(), d.end(), [](float x) { return x == 0.0F; });
  };
  if (is_none(shape) && is_none(volume)) return;
  for (Direction* d : {&shape, &volume, &strain}) {
    if (!is_none(*d)) out.push_back(std::move(*d));
  }
}

/// Root mean squares of the net's matrices, one a weight.
std::vector<double> sizes_of(const std::vector<float>& weights, std::size_t net) {
  std::vector<double> sizes(kNetWeights);
  const std::size_t ends[] = {0, kFirstMatrix, kLastMatrix, kNetWeights};
  for (int matrix = 0; matrix < 3; ++matrix) {
    double sum = 0.0;
    for (std::size_t i = ends[matrix]; i < ends[matrix + 1]; ++i) {
      sum += double(weights[net + i]) * double(weights[net + i]);
    }
    const double size = std::sqrt(sum / double(ends[matrix + 1] - ends[matrix]));
    std::fill(sizes.begin() + std::ptrdiff_t(ends[matrix]),
              sizes.begin() + std::ptrdiff_t(ends[matrix + 1]), std::max(size, kLeastSize));
  }
  return sizes;
}

/// Down the slope, as if each weight were in units of its matrix's size.
void add_descent(const std::vector<float>& weights, const std::vector<double>& slope,
                 std::size_t net, std::vector<Direction>& out) {
  const std::vector<double> sizes = sizes_of(weights, net);
  double sum = 0.0;
  for (std::size_t i = 0; i < kNetWeights; ++i) sum += std::pow(slope[net + i] * sizes[i], 2);
  const double unit = kDescentUnit * std::sqrt(double(kNetWeights) / sum);
  if (!std::isfinite(unit)) return;
  Direction d(kBothNets, 0.0F);
  for (std::size_t i = 0; i < kNetWeights; ++i) {
    d[net + i] = float(-unit * slope[net + i] * sizes[i] * sizes[i]);
  }
  out.push_back(std::move(d));
}

/// The search: weights and values as they are, and what is known of where to go.
class PublishedSearch {
 public:
  PublishedSearch(PublishedSteps& of, const PublishedLaw& start, std::vector<double> values)
      : of_(of), name_(start.name), weights_(start.weights), values_(std::move(values)) {}

  PublishedFound run(int iterations) {
    PublishedFound found;
    bool described = false;  // the descent is among the directions
    bool first = true;
    int worse = 0;
    while (found.steps < iterations && worse < kMostWorseSets) {
      of_.begin(law(), values_);
      if (std::exchange(first, false)) {
        found.without = found.best = of_.means();
        if (!found.without.seen) break;
      }
      const int taken = of_.steps(std::min(kStepsOfDirections, iterations - found.steps));
      found.steps += taken;
      if (taken == 0 && described) break;
      move_by(of_.values());
      slope_ = of_.slope();
      found.evaluations += of_.evaluations();
      described = true;
      if (taken == 0) continue;
      const FurtherMeans now = of_.means();
      const bool nearer = is_nearer(now, found.best);
      worse = nearer ? 0 : worse + 1;
      if (!nearer) continue;
      found.best = now;
      found.taken = true;
      found.weights = weights_;
      found.values = values_;
    }
    return found;
  }

 private:
  /// With where to go from the present weights.
  [[nodiscard]] std::shared_ptr<const PublishedLaw> law() {
    auto law = std::make_shared<PublishedLaw>(*material::make_published_law(weights_, name_));
    const std::vector<float> joined = material::joined_weights<float>(weights_);
    for (const std::size_t net : {std::size_t{0}, kNetWeights}) {
      add_factors(joined, net, law->directions);
      if (!slope_.empty()) add_descent(joined, slope_, net, law->directions);
    }
    law->directions.insert(law->directions.end(), moves_.begin(), moves_.end());
    along_ = law;
    return law;
  }

  /// Takes over what was found; the whole move is a direction of the next ones.
  void move_by(const std::vector<double>& found) {
    const auto own = found.begin() + std::ptrdiff_t(values_.size());
    material::Material material = material::published_material(along_);
    material.weight_moves.assign(own, found.end());
    values_.assign(found.begin(), own);
    const std::vector<float> before = material::joined_weights<float>(weights_);
    weights_ = material::moved_published(material);
    Direction move = material::joined_weights<float>(weights_);
    for (std::size_t i = 0; i < kBothNets; ++i) move[i] -= before[i];
    if (std::all_of(move.begin(), move.end(), [](float x) { return x == 0.0F; })) return;
    moves_.insert(moves_.begin(), std::move(move));
    if (moves_.size() > kMovesKept) moves_.pop_back();
  }

  PublishedSteps& of_;
  std::string name_;  ///< of the weights that it begins with
  PublishedWeights weights_;
  std::vector<double> values_;
  std::vector<double> slope_;     ///< by the weights; empty: not known
  std::vector<Direction> moves_;  ///< the last ones, the latest first
  std::shared_ptr<const PublishedLaw> along_;
};

}  // namespace

PublishedFound search_published(PublishedSteps& of, const PublishedLaw& start,
                                std::vector<double> values, int iterations) {
  return PublishedSearch(of, start, std::move(values)).run(iterations);
}

fit::SceneBuilder with_published(fit::SceneBuilder build, std::string body,
                                 std::shared_ptr<const PublishedLaw> law) {
  return [build = std::move(build), body = std::move(body), law = std::move(law)](
             double level, Arena& arena, const Interrupter& interrupter) {
    mpm::Scene scene = build(level, arena, interrupter);
    material::Material& material = scene.bodies[fit::body_index(scene, body)].material;
    material.published = law;
    material.youngs_modulus = law->youngs_modulus;
    material.poisson_ratio = law->poisson_ratio;
    material.weight_moves.assign(law->directions.size(), 0.0);
    return scene;
  };
}

}  // namespace matterfit::job
