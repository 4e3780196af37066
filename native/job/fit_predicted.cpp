// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_predicted.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "base/random.hpp"
#include "fit/numerics/student.hpp"
#include "mpm/step_limit.hpp"

namespace matterfit::job {
namespace {

constexpr std::uint64_t kDrawSeed = 1;
constexpr std::size_t kFewestDraws = 4;
/// Times the substeps of the fitted values that a draw may take: nine times the stiffness.
constexpr double kDear = 3.0;

double normal(Random& random) {
  const double u = 1.0 - random.uniform();
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * random.uniform());
}

/// Square root of a covariance that may be singular, or not quite positive by rounding.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  const Eigen::VectorXd lengths = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return solver.eigenvectors() * lengths.asDiagonal();
}

/// What is held out of a capture, as the draws have it.
struct Band {
  double band = 0.0;    ///< Σ of the squared half widths of the coordinates [m²]
  double missed = 0.0;  ///< Σ of the distances of the mean prediction [m]
  std::size_t samples = 0;
  std::size_t within = 0;  ///< coordinates

  void add(const Band& other) {
    band += other.band;
    missed += other.missed;
    samples += other.samples;
    within += other.within;
  }
  [[nodiscard]] Json json() const {
    const auto count = double(samples);
    return {{"samples", samples},
            {"mean_mm", 1e3 * missed / count},
            {"half_width_mm", 1e3 * std::sqrt(band / (3.0 * count))},
            {"coverage", double(within) / (3.0 * count)}};
  }
};

Band band_of(const fit::Capture& capture, const std::vector<const fit::SimulatedCapture*>& drawn) {
  Band result;
  const capture::Tracks& tracks = capture.input.tracks;
  for (std::size_t t = 0; t < tracks.frames(); ++t) {
    for (std::size_t i = 0; i < tracks.points; ++i) {
      const std::size_t at = t * tracks.points + i;
      if (capture.predicted[at] == 0) continue;
      Vec3d mean = Vec3d::Zero();
      for (const auto* one : drawn) mean += one->positions[at] / double(drawn.size());
      if (!mean.allFinite()) continue;
      Vec3d variance = Vec3d::Zero();
      for (const auto* one : drawn) {
        variance += (one->positions[at] - mean).cwiseAbs2() / double(drawn.size());
      }
      const Vec3d off = tracks.position(t, i) - mean;
      const double noise = capture.deviation(i);
      result.samples += 1;
      result.missed += off.norm();
      for (int axis = 0; axis < 3; ++axis) {
        const double wide = fit::kNormalQuantile * fit::kNormalQuantile;
        result.band += wide * variance[axis];
        if (off[axis] * off[axis] <= wide * (variance[axis] + noise * noise)) ++result.within;
      }
    }
  }
  return result;
}

bool holds_out(const std::vector<fit::Run>& runs) {
  return std::any_of(runs.begin(), runs.end(), [](const fit::Run& run) {
    return std::any_of(run.captures.begin(), run.captures.end(), [](const fit::Capture& capture) {
      return std::any_of(capture.predicted.begin(), capture.predicted.end(),
                         [](std::uint8_t one) { return one != 0; });
    });
  });
}

/// The pairs of sets of which neither takes many times the substeps of the fitted values: E that a
/// recording hardly identifies is drawn up to its bound, and the rest waits for those.
std::vector<std::vector<double>> without_dear(fit::LawFit& fit, const std::vector<double>& values,
                                              const std::vector<std::vector<double>>& sets) {
  std::vector<double> usual;
  usual.reserve(fit.runs().size());
  for (std::size_t r = 0; r < fit.runs().size(); ++r) {
    usual.push_back(mpm::step_limit(fit.model().scene_at(values, r)));
  }
  const auto is_dear = [&](const std::vector<double>& set) {
    for (std::size_t r = 0; r < usual.size(); ++r) {
      if (usual[r] > kDear * mpm::step_limit(fit.model().scene_at(set, r))) return true;
    }
    return false;
  };
  std::vector<std::vector<double>> kept;
  for (std::size_t pair = 0; pair + 1 < sets.size(); pair += 2) {
    if (is_dear(sets[pair]) || is_dear(sets[pair + 1])) continue;
    kept.push_back(sets[pair]);
    kept.push_back(sets[pair + 1]);
  }
  return kept;
}

}  // namespace

std::vector<std::vector<double>> drawn_values(const std::vector<fit::Parameter>& parameters,
                                              const std::vector<double>& values,
                                              const fit::Uncertainty& known, int count,
                                              std::uint64_t seed) {
  std::vector<std::size_t> moved;
  std::vector<double> errors;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const fit::Estimate& estimate = known.estimates[k];
    const double wide = std::max(1.0, estimate.quantile / fit::kNormalQuantile);
    const double error = std::hypot(wide * estimate.standard_error, estimate.grid_error);
    if (!std::isfinite(error) || !(error > 0.0)) continue;
    const fit::Coordinate coordinate = parameters[k].coordinate;
    moved.push_back(k);
    errors.push_back(error / fit::derivative(coordinate, fit::to_natural(coordinate, values[k])));
  }
  const auto size = static_cast<Eigen::Index>(moved.size());
  const Eigen::Index pairs = (count + 1) / 2;
  if (size == 0 || pairs == 0) return {};
  Eigen::MatrixXd covariance(size, size);
  for (Eigen::Index a = 0; a < size; ++a) {
    for (Eigen::Index b = 0; b < size; ++b) {
      const auto i = static_cast<std::size_t>(a);
      const auto j = static_cast<std::size_t>(b);
      covariance(a, b) = errors[i] * errors[j] *
                         known.correlation(static_cast<Eigen::Index>(moved[i]),
                                           static_cast<Eigen::Index>(moved[j]));
    }
  }
  Random random(seed);
  Eigen::MatrixXd steps(size, pairs);
  for (Eigen::Index c = 0; c < pairs; ++c) {
    for (Eigen::Index r = 0; r < size; ++r) steps(r, c) = normal(random);
  }
  if (size <= pairs) {  // the covariance of these few is made exact
    const Eigen::MatrixXd found = steps * steps.transpose() / double(pairs);
    steps = found.llt().matrixL().solve(steps).eval();
  }
  steps = (root_of(covariance) * steps).eval();
  std::vector<std::vector<double>> sets;
  for (Eigen::Index c = 0; c < pairs; ++c) {
    for (const double sign : {1.0, -1.0}) {
      std::vector<double> set = values;
      for (Eigen::Index r = 0; r < size; ++r) {
        const std::size_t k = moved[static_cast<std::size_t>(r)];
        const double at = fit::to_natural(parameters[k].coordinate, values[k]);
        set[k] = fit::value_within_bounds(parameters[k], at + sign * steps(r, c));
      }
      sets.push_back(std::move(set));
    }
  }
  return sets;
}

Json predicted_json(fit::LawFit& fit, const fit::LawState& state, const fit::Uncertainty& known,
                    int draws, const std::function<void(double)>& progress) {
  if (draws == 0 || fit.loss() != fit::Loss::kTracks || !holds_out(fit.runs())) return {};
  const std::vector<std::vector<double>> sets =
      drawn_values(fit.parameters().parameters(), state.values, known, draws, kDrawSeed);
  const std::vector<std::vector<double>> affordable = without_dear(fit, state.values, sets);
  if (affordable.empty()) return {};
  const fit::Evaluation found =
      fit.model().evaluate(affordable, fit::whole_scope(fit.runs()), progress);
  std::vector<const fit::Outcome*> outcomes;
  for (const std::optional<fit::Outcome>& outcome : found.outcomes) {
    if (outcome) outcomes.push_back(&*outcome);
  }
  if (outcomes.size() < kFewestDraws) return {};
  Band all;
  Json captures = Json::array();
  const std::vector<fit::Run>& runs = fit.runs();
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (std::size_t c = 0; c < runs[r].captures.size(); ++c) {
      std::vector<const fit::SimulatedCapture*> drawn;
      drawn.reserve(outcomes.size());
      for (const fit::Outcome* outcome : outcomes) drawn.push_back(&(*outcome)[r].captures[c]);
      const Band band = band_of(runs[r].captures[c], drawn);
      if (band.samples == 0) continue;
      Json json = band.json();
      json["name"] = runs[r].captures[c].input.name;
      captures.push_back(std::move(json));
      all.add(band);
    }
  }
  if (all.samples == 0) return {};
  Json json = all.json();
  json["draws"] = outcomes.size();
  json["too_dear"] = sets.size() - affordable.size();
  json["captures"] = std::move(captures);
  return json;
}

}  // namespace matterfit::job
