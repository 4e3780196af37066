// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/next_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "diagnose/observe.hpp"
#include "diagnose/refit.hpp"
#include "diagnose/scores.hpp"
#include "diagnose/whitening.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The model of an experiment: its layout as the only capture.
class ExperimentModel : public Model {
 public:
  ExperimentModel(const Model& model, int experiment)
      : model_(model),
        experiment_(experiment),
        captures_{model.experiments()[std::size_t(experiment)].layout},
        effects_(model.effects()) {
    captures_[0].positions = VectorXd::Zero(3 * captures_[0].samples());
    captures_[0].use.assign(std::size_t(captures_[0].samples()), Use::kUsed);
    for (Effect& effect : effects_) effect.captures.clear();
  }
  const std::vector<Capture>& captures() const override { return captures_; }
  const std::vector<fit::Parameter>& parameters() const override { return model_.parameters(); }
  std::vector<int> own_capture() const override { return model_.own_capture(); }
  const std::vector<Effect>& effects() const override { return effects_; }
  std::vector<std::optional<Motion>> simulate(const std::vector<Point>& points) const override {
    return model_.simulate_experiment(experiment_, points);
  }
  bool has_numerics() const override { return false; }

 private:
  const Model& model_;
  int experiment_;
  std::vector<Capture> captures_;
  std::vector<Effect> effects_;
};

std::vector<Tested> tested_of(const Model& model, const std::vector<Candidate>& candidates) {
  std::vector<Tested> tested;
  Index first = 0;
  for (const Candidate& candidate : candidates) {
    const Index count = Index(model.effects()[std::size_t(candidate.effect)].numbers.size());
    tested.push_back({candidate, first, count, VectorXd::Constant(count, -1e300),
                      VectorXd::Constant(count, 1e300)});
    first += count;
  }
  return tested;
}

/// How far the present samples and new ones tell rival k from rival l, k != l: λ (1 − C²).
using Apart = std::map<std::pair<std::size_t, std::size_t>, double>;

Apart apart_by(const ScoreTest& test, const std::vector<Tested>& tested,
               const std::vector<Rival>& rivals) {
  Apart result;
  for (std::size_t k = 0; k < rivals.size(); ++k) {
    const VectorXd& alpha = rivals[k].estimate;
    const double strength = alpha.dot(test.information().block(tested[k].first, tested[k].first,
                                                               tested[k].count, tested[k].count) *
                                      alpha);
    for (std::size_t l = 0; l < rivals.size(); ++l) {
      if (l == k || rivals[l].candidate.effect == rivals[k].candidate.effect) continue;
      result[{k, l}] = strength * (1.0 - test.imitation(k, alpha, l));
    }
  }
  return result;
}

/// "A and B stay alike in each recording that was tried." for each pair that none tells apart.
std::string stay_alike(const Model& model, const std::vector<Rival>& rivals, const Apart& most,
                       double enough) {
  std::set<std::pair<std::string, std::string>> pairs;
  for (const auto& [pair, apart] : most) {
    if (apart >= enough) continue;
    const auto name = [&](std::size_t k) {
      return model.effects()[std::size_t(rivals[k].candidate.effect)].name;
    };
    pairs.insert(std::minmax(name(pair.first), name(pair.second)));
  }
  std::string text;
  for (const auto& [one, other] : pairs) {
    text += fmt::format(" {} and {} stay alike in each recording that was tried.", one, other);
  }
  return text;
}

}  // namespace

MatrixXd experiment_gram(const Study& study, int experiment,
                         const std::vector<Candidate>& candidates, const Noise& noise) {
  const ExperimentModel model(study.model(), experiment);
  const Study there(model, study.used().size());
  const State state = there.fitted();
  if (!there.motions({state})[0]) return {};
  // Nuisances of known times are of what happened in the present recordings.
  DifferenceOptions differences;
  differences.central = false;
  differences.left_out = nuisances_of_times(study.model());
  const Linearised slopes = linearise(there, state, candidates, differences);
  Index columns = slopes.theta.cols();
  for (const auto& column : slopes.columns) {
    if (column.values.cols() == 0) return {};
    columns += column.values.cols();
  }
  MatrixXd all(there.size(), columns);
  all.leftCols(slopes.theta.cols()) = slopes.theta;
  Index at = slopes.theta.cols();
  for (const auto& column : slopes.columns) {
    all.middleCols(at, column.values.cols()) = column.values;
    at += column.values.cols();
  }
  Noise same;
  same.captures = {noise.captures.front()};
  const MatrixXd white =
      Whitening(there.used(), for_rows(same, there.used()), MatrixXd(there.size(), 0)).apply(all);
  return white.transpose() * white;
}

MatrixXd join_recordings(const MatrixXd& present, const MatrixXd& fresh, Index p,
                         const std::vector<int>& own) {
  const Index width = present.cols();
  const Index extra = Index(std::ranges::count_if(own, [](int capture) { return capture >= 0; }));
  std::vector<Index> old_place(std::size_t(width), 0);
  std::vector<Index> new_place(std::size_t(width), 0);
  Index at = p;
  for (Index i = 0; i < width; ++i) {
    old_place[std::size_t(i)] = i < p ? i : i + extra;
    const bool is_own = i < p && own[std::size_t(i)] >= 0;
    new_place[std::size_t(i)] = is_own ? at++ : old_place[std::size_t(i)];
  }
  MatrixXd sum = MatrixXd::Zero(width + extra, width + extra);
  for (Index i = 0; i < width; ++i) {
    for (Index j = 0; j < width; ++j) {
      sum(old_place[std::size_t(i)], old_place[std::size_t(j)]) += present(i, j);
      sum(new_place[std::size_t(i)], new_place[std::size_t(j)]) += fresh(i, j);
    }
  }
  return sum;
}

std::string separating_recording(const Study& study, const Linearised& slopes, const Noise& noise,
                                 const std::vector<Rival>& rivals) {
  const Model& model = study.model();
  const std::vector<Experiment> experiments = model.experiments();
  std::vector<Candidate> candidates;
  candidates.reserve(rivals.size());
  for (const Rival& rival : rivals) candidates.push_back(rival.candidate);

  // Present samples.
  const Index used = study.used().size();
  const std::vector<Tested> tested = tested_of(model, candidates);
  const Index p = slopes.theta.cols();
  const Index width = p + (tested.empty() ? 0 : tested.back().first + tested.back().count);
  MatrixXd columns(used, width);
  columns.leftCols(p) = slopes.theta.topRows(used);
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    for (const auto& column : slopes.columns) {
      if (column.candidate.effect == candidates[k].effect &&
          column.candidate.variant == candidates[k].variant) {
        columns.middleCols(p + tested[k].first, tested[k].count) = column.values.topRows(used);
      }
    }
  }
  const MatrixXd white = Whitening(study.used(), noise, MatrixXd(used, 0)).apply(columns);
  const MatrixXd present = white.transpose() * white;
  const std::vector<int> own = model.own_capture();

  std::vector<std::pair<const Experiment*, Apart>> tried;
  Apart most;
  for (std::size_t e = 0; e < experiments.size(); ++e) {
    const MatrixXd gram = experiment_gram(study, int(e), candidates, noise);
    if (gram.size() == 0) continue;
    const MatrixXd sum = join_recordings(present, gram, p, own);
    const Index extra = sum.cols() - width;
    VectorXd precision = VectorXd::Zero(p + extra);
    precision.head(p) = theta_prior(model, noise.corrections).precision;
    const ScoreTest test(sum, precision, tested);
    Apart apart = apart_by(test, tested, rivals);
    for (const auto& [pair, value] : apart) most[pair] = std::max(most[pair], value);
    tried.emplace_back(&experiments[e], std::move(apart));
  }
  // Less than that and the new recording would end in the same class.
  constexpr double kWorthIt = 9.2;
  const Experiment* best = nullptr;
  double largest = kWorthIt;
  for (const auto& [experiment, apart] : tried) {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [pair, value] : apart) {
      // Rivals that look alike in each recording decide nothing.
      if (most.at(pair) >= kWorthIt) least = std::min(least, value);
    }
    if (std::isfinite(least) && least >= largest) {
      largest = least;
      best = experiment;
    }
  }
  return best ? best->sentence + stay_alike(model, rivals, most, kWorthIt) : "";
}

}  // namespace matterfit::diagnose
