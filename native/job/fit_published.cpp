// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_published.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <tuple>
#include <utility>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "job/fit_report.hpp"
#include "job/fit_weights.hpp"
#include "material/neural/published_file.hpp"
#include "material/neural/published_law.hpp"
#include "material/neural/published_material.hpp"

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

/// The builder's scenes with a law on the body, its moves 0.
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

/// The search: weights and values as they are, and what is known of where to go.
class PublishedSearch {
 public:
  PublishedSearch(const FurtherStart& from, const Interrupter& interrupter,
                  std::vector<std::string>& statements, std::vector<Json>& history)
      : from_(from),
        interrupter_(interrupter),
        statements_(statements),
        history_(history),
        values_(from.before.values) {
    const fit::LawFit as_it_is(from.setup, interrupter, statements);
    const mpm::Scene& scene = as_it_is.scenes().front();
    const auto& law = scene.bodies[fit::body_index(scene, from.body)].material.published;
    name_ = law->name;
    weights_ = law->weights;
  }

  FurtherFit run() {
    bool described = false;  // the descent is among the directions
    int worse = 0;
    while (steps_ < from_.iterations && worse < kMostWorseSets) {
      const auto fit = make_fit(directions());
      fit::LawState state = begin(*fit);
      if (!without_) {
        without_ = means_of(*fit, state);
        best_ = *without_;
        if (!without_->seen) break;
      }
      const int taken = take_steps(*fit, state);
      if (taken == 0 && described) break;
      move_by(*fit, state);
      describe(*fit, state);
      described = true;
      if (taken == 0) continue;
      const FurtherMeans now = means_of(*fit, state);
      const bool nearer = without_->held ? now.held && *now.held < *best_.held
                                         : now.seen && *now.seen < *best_.seen;
      worse = nearer ? 0 : worse + 1;
      if (!nearer) continue;
      best_ = now;
      nearest_ = {weights_, values_};
    }
    return result();
  }

 private:
  [[nodiscard]] std::vector<Direction> directions() const {
    const std::vector<float> joined = material::joined_weights<float>(weights_);
    std::vector<Direction> out;
    for (const std::size_t net : {std::size_t{0}, kNetWeights}) {
      add_factors(joined, net, out);
      if (!slope_.empty()) add_descent(joined, slope_, net, out);
    }
    out.insert(out.end(), moves_.begin(), moves_.end());
    return out;
  }

  [[nodiscard]] std::unique_ptr<fit::LawFit> make_fit(std::vector<Direction> along) const {
    auto law = std::make_shared<PublishedLaw>(*material::make_published_law(weights_, name_));
    law->directions = std::move(along);
    fit::SearchSetup setup = from_.setup;
    for (fit::SceneBuilder& builder : setup.builders) {
      builder = with_published(std::move(builder), from_.body, law);
    }
    for (fit::ParameterSpec& move : weight_moves_of(from_.body, 0, law->directions.size())) {
      setup.parameters.push_back(std::move(move));
    }
    auto fit = std::make_unique<fit::LawFit>(std::move(setup), interrupter_, statements_);
    fit->report = from_.tell;
    return fit;
  }

  /// At the present values, no weight moved.
  [[nodiscard]] fit::LawState begin(const fit::LawFit& fit) const {
    std::vector<double> values = fit.start().values;
    std::copy(values_.begin(), values_.end(), values.begin());
    return fit.at_last_stage(std::move(values));
  }

  int take_steps(fit::LawFit& fit, fit::LawState& state) {
    const int most = std::min(kStepsOfDirections, from_.iterations - steps_);
    while (!state.finished() && state.iterations < most) advance(fit, state, history_);
    steps_ += state.iterations;
    return state.iterations;
  }

  /// Takes over what was found; the whole move is a direction of the next ones.
  void move_by(const fit::LawFit& fit, const fit::LawState& state) {
    const std::size_t own = values_.size();
    std::copy_n(state.values.begin(), own, values_.begin());
    const mpm::Scene scene = fit.scenes().front();
    material::Material material = scene.bodies[fit::body_index(scene, from_.body)].material;
    material.weight_moves.assign(state.values.begin() + std::ptrdiff_t(own), state.values.end());
    const std::vector<float> before = material::joined_weights<float>(weights_);
    weights_ = material::moved_published(material);
    Direction move = material::joined_weights<float>(weights_);
    for (std::size_t i = 0; i < kBothNets; ++i) move[i] -= before[i];
    if (std::all_of(move.begin(), move.end(), [](float x) { return x == 0.0F; })) return;
    moves_.insert(moves_.begin(), std::move(move));
    if (moves_.size() > kMovesKept) moves_.pop_back();
  }

  /// The slope where the search is now.
  void describe(fit::LawFit& fit, fit::LawState& state) {
    slope_.clear();
    try {
      fit.compare(state);
      if (auto slope = fit.published_slope(state, from_.body)) slope_ = std::move(*slope);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kCompute) throw;
    }
    evaluations_ += state.evaluations;
  }

  FurtherFit result() {
    FurtherFit result;
    result.key = "weights";
    if (without_->seen && nearest_) {
      std::tie(weights_, values_) = *nearest_;
      result.fit = make_fit({});
      result.state = begin(*result.fit);
      if (!values_.empty()) result.fit->compare(result.state);  // for their errors
      result.taken = true;
      result.state.iterations = from_.before.iterations + steps_;
      result.state.evaluations = from_.before.evaluations + evaluations_;
      result.state.phase = from_.before.phase;
      result.state.statements = from_.before.statements;
    }
    result.report =
        further_report(from_.body, result.taken, steps_, evaluations_, *without_, best_);
    return result;
  }

  const FurtherStart& from_;
  const Interrupter& interrupter_;
  std::vector<std::string>& statements_;
  std::vector<Json>& history_;
  std::string name_;  ///< of the weights that it begins with
  PublishedWeights weights_;
  std::vector<double> values_;
  std::vector<double> slope_;     ///< by the weights; empty: not known
  std::vector<Direction> moves_;  ///< the last ones, the latest first
  int steps_ = 0;
  int evaluations_ = 0;
  std::optional<FurtherMeans> without_;
  FurtherMeans best_;
  std::optional<std::pair<PublishedWeights, std::vector<double>>> nearest_;
};

}  // namespace

FurtherFit fit_published_weights(const FurtherStart& from, const Interrupter& interrupter,
                                 std::vector<std::string>& statements, std::vector<Json>& history) {
  FurtherFit result = PublishedSearch(from, interrupter, statements, history).run();
  add_weights_statement(from.body, "all weights of its nets", result, statements);
  return result;
}

void write_published_weights(const PublishedWeights& weights, const std::string& body,
                             const std::filesystem::path& folder, Json& document) {
  write_weights_file(material::published_tensors(weights), "neural", body, folder, document);
}

}  // namespace matterfit::job
