// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/starts.hpp"

#include <algorithm>

namespace matterfit::diagnose {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd beside(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd result(a.rows(), a.cols() + b.cols());
  result << a, b;
  return result;
}

bool stands(const Model& model, const Candidate& cause, const std::vector<Candidate>& causes) {
  const std::string& needed = model.effects()[std::size_t(cause.effect)].beside;
  return needed.empty() || std::ranges::any_of(causes, [&](const Candidate& other) {
           return model.effects()[std::size_t(other.effect)].name == needed;
         });
}

std::vector<std::size_t> best_shapes(const std::vector<Score>& scores) {
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < scores.size(); ++k) {
    if (scores[k].observable) order.push_back(k);
  }
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    return scores[a].equivalent > scores[b].equivalent;
  });
  std::vector<std::size_t> result;
  for (const std::size_t k : order) {
    const bool seen = std::ranges::any_of(result, [&](std::size_t other) {
      return scores[other].candidate.effect == scores[k].candidate.effect;
    });
    if (!seen) result.push_back(k);
  }
  return result;
}

std::vector<std::size_t> unlike_shapes(const ScoreTest& test, const std::vector<Score>& scores,
                                       std::size_t most,
                                       const std::function<bool(const Score&)>& of_use) {
  constexpr double kAlike = 0.9;
  std::vector<std::size_t> chosen;
  for (const std::size_t k : best_shapes(scores)) {
    if (chosen.size() >= most) break;
    if (of_use && !of_use(scores[k])) continue;
    const bool alike = std::ranges::any_of(chosen, [&](std::size_t other) {
      return test.imitation(other, scores[other].estimate, k) > kAlike;
    });
    if (!alike) chosen.push_back(k);
  }
  return chosen;
}

Linearised linearised_at(const Refit& refit) {
  const Index p = refit.state.theta.size();
  Linearised slopes;
  slopes.prediction = refit.prediction;
  slopes.theta = refit.slopes.leftCols(p);
  slopes.active = refit.slopes.rightCols(refit.slopes.cols() - p);
  return slopes;
}

const MatrixXd& columns_of(const Linearised& slopes, const Candidate& candidate) {
  const auto found = std::ranges::find_if(slopes.columns, [&](const Linearised::Column& column) {
    return column.candidate.effect == candidate.effect &&
           column.candidate.variant == candidate.variant;
  });
  return found->values;
}

State extended(const Model& model, const State& state, const Candidate& candidate,
               const VectorXd& estimate, double share) {
  State result = state;
  const Effect& effect = model.effects()[std::size_t(candidate.effect)];
  Active cause{candidate.effect, candidate.variant, VectorXd(estimate.size())};
  for (Index k = 0; k < estimate.size(); ++k) {
    const Number& number = effect.numbers[std::size_t(k)];
    cause.values[k] =
        std::clamp(number.neutral + share * estimate[k] * number.scale, number.low, number.high);
  }
  result.causes.push_back(std::move(cause));
  return result;
}

}  // namespace matterfit::diagnose
