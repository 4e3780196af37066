// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/placebo.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "diagnose/random.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// How well an ensemble stands for another solver's error: its size to a factor of e^±this.
constexpr double kLikeness = 0.35;

/// L with L Lᵀ = C, C semidefinite.
MatrixXd root(const MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(covariance);
  return solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

VectorXd normal_vector(Random& random, Index size) {
  VectorXd result(size);
  for (Index i = 0; i < size; ++i) result[i] = random.normal();
  return result;
}

double tail(const std::vector<double>& sorted, double value) {
  if (sorted.empty()) return 0.0;
  const auto above = sorted.end() - std::lower_bound(sorted.begin(), sorted.end(), value);
  return (double(above) + 1.0) / (double(sorted.size()) + 1.0);
}

double quantile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return 0.0;
  const auto last = double(sorted.size() - 1);
  return sorted[std::size_t(std::ceil(share * last))];
}

}  // namespace

double Placebo::p(double equivalent) const {
  return std::max(tail(noise, equivalent), tail(solver, equivalent));
}

void draw_noise(const ScoreTest& test, const std::vector<MatrixXd>& covariances, double freedom,
                const PlaceboOptions& options, Placebo& placebo) {
  const VectorXd prior = test.precision().cwiseSqrt();
  const int each = std::max(1, options.draws / int(covariances.size()));
  placebo.noise.reserve(covariances.size() * std::size_t(each));
  for (std::size_t n = 0; n < covariances.size(); ++n) {
    const MatrixXd factor = root(covariances[n]);
    for (int i = 0; i < each; ++i) {
      Random random(options.seed, n * 1000003 + std::uint64_t(i));
      const double scale = std::exp(random.normal() / std::sqrt(2.0 * std::max(freedom, 2.0)));
      const VectorXd products = scale * (factor * normal_vector(random, factor.cols()));
      const VectorXd pull = prior.cwiseProduct(normal_vector(random, prior.size()));
      placebo.noise.push_back(test.largest(test.numerators(products, pull)));
    }
  }
  std::ranges::sort(placebo.noise);
}

void draw_members(const MatrixXd& gram, const std::vector<int>& member, const VectorXd& precision,
                  const std::vector<Tested>& tested, const PlaceboOptions& options,
                  Placebo& placebo) {
  if (member.empty()) return;
  const Index members = 1 + *std::ranges::max_element(member);
  if (members < 4) return;
  const Index columns = Index(member.size());
  const Index width = gram.cols() - columns - members;
  const VectorXd prior = precision.cwiseSqrt();
  placebo.solver.reserve(std::size_t(members) * std::size_t(options.member_draws));
  for (Index m = 0; m < members; ++m) {
    // Woodbury with what the others make, so many fewer that each counts for more.
    std::vector<Index> others;
    std::vector<double> shares;
    others.reserve(std::size_t(columns));
    shares.reserve(std::size_t(columns));
    std::vector<Index> signals{width + columns + m};
    for (Index k = 0; k < columns; ++k) {
      const int of = member[std::size_t(k)];
      if (of == int(m)) continue;
      others.push_back(width + k);
      shares.push_back(of < 0 ? 1.0 : std::sqrt(double(members) / double(members - 1)));
      if (of < 0) signals.push_back(width + k);
    }
    const auto share = Eigen::Map<const VectorXd>(shares.data(), Index(shares.size())).asDiagonal();
    const MatrixXd p = gram.topLeftCorner(width, width);
    const MatrixXd q = gram(Eigen::seqN(0, width), others) * share;
    const MatrixXd r = share * gram(others, others) * share;
    const MatrixXd qs =
        (r + MatrixXd::Identity(r.rows(), r.cols())).llt().solve(q.transpose()).transpose();
    const ScoreTest test(p - qs * q.transpose(), precision, tested);
    const MatrixXd signal =
        gram(Eigen::seqN(0, width), signals) - qs * (share * gram(others, signals));
    const MatrixXd factor = root(p - 2.0 * qs * q.transpose() + qs * r * qs.transpose());
    for (int i = 0; i < options.member_draws; ++i) {
      Random random(options.seed + 1, std::uint64_t(m) * 1000003 + std::uint64_t(i));
      VectorXd amounts = normal_vector(random, signal.cols());
      amounts[0] = std::exp(kLikeness * amounts[0]);
      const VectorXd products = signal * amounts + factor * normal_vector(random, factor.cols());
      const VectorXd pull = prior.cwiseProduct(normal_vector(random, prior.size()));
      placebo.solver.push_back(test.largest(test.numerators(products, pull)));
    }
  }
  std::ranges::sort(placebo.solver);
}

void set_threshold(const PlaceboOptions& options, Placebo& placebo) {
  placebo.threshold = std::max(quantile(placebo.noise, 1.0 - options.level),
                               quantile(placebo.solver, 1.0 - options.level));
}

}  // namespace matterfit::diagnose
