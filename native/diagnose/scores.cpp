// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/scores.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "diagnose/chi_square.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// (H)⁻¹ B for H positive semidefinite: in units of its diagonal, directions that nothing observes
/// left out.
MatrixXd solve_semidefinite(const MatrixXd& h, const MatrixXd& b) {
  const VectorXd unit = h.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(unit.asDiagonal() * h * unit.asDiagonal());
  const VectorXd& values = solver.eigenvalues();
  VectorXd inverse = VectorXd::Zero(values.size());
  for (Index i = 0; i < values.size(); ++i) {
    if (values[i] > 1e-10 * values[values.size() - 1]) inverse[i] = 1.0 / values[i];
  }
  const MatrixXd& q = solver.eigenvectors();
  return unit.asDiagonal() *
         (q * (inverse.asDiagonal() * (q.transpose() * (unit.asDiagonal() * b))));
}

}  // namespace

ScoreTest::ScoreTest(const MatrixXd& gram, const VectorXd& precision, std::vector<Tested> tested)
    : precision_(precision), tested_(std::move(tested)) {
  const Index n = precision.size();
  const Index k = gram.cols() - n;
  const MatrixXd cross = gram.topRightCorner(n, k);
  MatrixXd h = gram.topLeftCorner(n, n);
  h.diagonal() += precision;
  project_ = n > 0 ? MatrixXd(solve_semidefinite(h, cross).transpose()) : MatrixXd(k, 0);
  const MatrixXd raw = gram.bottomRightCorner(k, k);
  information_ = raw - project_ * cross;
  information_ = (0.5 * (information_ + information_.transpose())).eval();
  parts_.reserve(tested_.size());
  for (const Tested& t : tested_) {
    // Directions among the numbers in which the refit of the nuisances leaves enough.
    const MatrixXd own = information_.block(t.first, t.first, t.count, t.count);
    const MatrixXd whole = raw.block(t.first, t.first, t.count, t.count);
    const VectorXd unit = whole.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(unit.asDiagonal() * own *
                                                         unit.asDiagonal());
    Part part;
    part.inverse = MatrixXd::Zero(t.count, t.count);
    for (Index i = 0; i < t.count; ++i) {
      const double value = solver.eigenvalues()[i];
      // Numbers that act alike have more in common than each has by itself.
      const VectorXd direction = unit.asDiagonal() * solver.eigenvectors().col(i);
      const double before = std::max(direction.dot(whole * direction), 1e-300);
      if (i + 1 == t.count || value > kKeepLimit * kKeepLimit) {
        part.keep = std::max(part.keep, std::sqrt(std::clamp(value / before, 0.0, 1.0)));
      }
      if (!(value > kKeepLimit * kKeepLimit) || !(whole.diagonal().maxCoeff() > 0.0)) continue;
      part.inverse += direction * direction.transpose() / value;
      ++part.freedom;
    }
    if (t.precision.size() > 0 && part.freedom > 0) {
      part.inverse = MatrixXd(own + MatrixXd(t.precision.asDiagonal())).inverse();
    }
    parts_.push_back(std::move(part));
  }
}

VectorXd ScoreTest::numerators(const VectorXd& products, const VectorXd& pull) const {
  const Index n = precision_.size();
  return products.tail(products.size() - n) - project_ * (products.head(n) - pull);
}

MatrixXd ScoreTest::curvature(std::size_t k) const {
  const Tested& t = tested_[k];
  MatrixXd result = information_.block(t.first, t.first, t.count, t.count);
  if (t.precision.size() > 0) result.diagonal() += t.precision;
  return result;
}

double ScoreTest::statistic(std::size_t k, const VectorXd& s, VectorXd* estimate) const {
  const Tested& t = tested_[k];
  const Part& part = parts_[k];
  if (part.freedom == 0) return 0.0;
  const VectorXd own = s.segment(t.first, t.count);
  VectorXd alpha = part.inverse * own;
  const VectorXd inside = alpha.cwiseMax(t.low).cwiseMin(t.high);
  double value = own.dot(alpha);
  if (inside != alpha) {
    // The gain of the nearest allowed values.
    alpha = inside;
    value = 2.0 * own.dot(alpha) - alpha.dot(curvature(k) * alpha);
  }
  if (estimate) *estimate = alpha;
  return std::max(value, 0.0);
}

std::vector<Score> ScoreTest::scores(const VectorXd& s) const {
  std::vector<Score> result;
  result.reserve(tested_.size());
  for (std::size_t k = 0; k < tested_.size(); ++k) {
    Score score;
    score.candidate = tested_[k].candidate;
    score.keep = parts_[k].keep;
    score.freedom = parts_[k].freedom;
    score.observable = score.freedom > 0;
    score.estimate = VectorXd::Zero(tested_[k].count);
    score.statistic = statistic(k, s, &score.estimate);
    score.error = parts_[k].inverse.diagonal().cwiseMax(0.0).cwiseSqrt();
    if (score.observable) score.equivalent = equivalent_of_one(score.statistic, score.freedom);
    result.push_back(std::move(score));
  }
  return result;
}

double ScoreTest::largest(const VectorXd& s) const {
  double best = 0.0;
  for (std::size_t k = 0; k < tested_.size(); ++k) {
    const double value = statistic(k, s, nullptr);
    // The equivalent is never larger than the statistic.
    if (value > best) best = std::max(best, equivalent_of_one(value, parts_[k].freedom));
  }
  return best;
}

double ScoreTest::imitation(std::size_t k, const VectorXd& estimate, std::size_t l) const {
  const Tested& a = tested_[k];
  const Tested& b = tested_[l];
  const double strength =
      estimate.dot(information_.block(a.first, a.first, a.count, a.count) * estimate);
  if (!(strength > 0.0)) return 0.0;
  const VectorXd s = information_.block(b.first, a.first, b.count, a.count) * estimate;
  return std::clamp(s.dot(parts_[l].inverse * s) / strength, 0.0, 1.0);
}

double ScoreTest::error_of(std::size_t k, Index number) const {
  return std::sqrt(std::max(parts_[k].inverse(number, number), 0.0));
}

ScoreTest::Pair ScoreTest::pair(const VectorXd& s, std::size_t k, std::size_t l) const {
  const Tested& a = tested_[k];
  const Tested& b = tested_[l];
  const Index count = a.count + b.count;
  MatrixXd info(count, count);
  info << information_.block(a.first, a.first, a.count, a.count),
      information_.block(a.first, b.first, a.count, b.count),
      information_.block(b.first, a.first, b.count, a.count),
      information_.block(b.first, b.first, b.count, b.count);
  VectorXd own(count);
  own << s.segment(a.first, a.count), s.segment(b.first, b.count);
  VectorXd low(count);
  low << a.low, b.low;
  VectorXd high(count);
  high << a.high, b.high;
  VectorXd alpha = solve_semidefinite(info, own);
  alpha = alpha.cwiseMax(low).cwiseMin(high).eval();
  Pair result;
  result.statistic = std::max(2.0 * own.dot(alpha) - alpha.dot(info * alpha), 0.0);
  result.first = alpha.head(a.count);
  result.second = alpha.tail(b.count);
  return result;
}

}  // namespace matterfit::diagnose
