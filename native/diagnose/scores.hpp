// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// What is projected out of every score: fitted parameters, active causes, the grid's bias.
struct Nuisances {
  Eigen::MatrixXd columns;    ///< whitened, derivatives of the prediction
  Eigen::VectorXd precision;  ///< Λ, diagonal; 0: no prior
  Eigen::VectorXd pull;       ///< Λ (θ̂ − θ₀)
};

/// A candidate's place among the columns, and what its numbers may be.
struct Tested {
  Candidate candidate;
  Eigen::Index first = 0;
  Eigen::Index count = 0;
  Eigen::VectorXd low;  ///< α in scales, from neutral
  Eigen::VectorXd high;
  Eigen::VectorXd precision = {};  ///< of the numbers' priors about neutral; empty: none
};

/// The score of one candidate.
struct Score {
  Candidate candidate;
  double statistic = 0.0;  ///< T, χ² of `freedom` where nothing is hidden
  int freedom = 0;
  double equivalent = 0.0;  ///< of one degree of freedom; what is ranked and compared to thresholds
  double keep = 0.0;        ///< κ: what of the signature the refit of the nuisances leaves
  bool observable = false;
  Eigen::VectorXd estimate;  ///< α̂ in scales, within its bounds
  Eigen::VectorXd error;     ///< of each number, in scales
};

/// κ below which a cause is not observable: 98 % of it would be taken for other parameters' values,
/// and differences of runs are hardly that exact.
inline constexpr double kKeepLimit = 0.02;

/// Score (Lagrange multiplier) test of every candidate with all nuisances projected out (Rao 1948;
/// the modification index of structural-equation models, Sörbom 1989):
///   s = Jᵀ (r − N H⁻¹ (Nᵀ r − pull)), H = NᵀN + Λ, I = JᵀJ − JᵀN H⁻¹ NᵀJ, T = sᵀ I⁺ s,
/// with priors of the candidate's own numbers sᵀ (I + Λ_k)⁻¹ s,
/// on whitened columns, from their Gram matrix alone: whatever draws or reweights works on that.
class ScoreTest {
 public:
  /// `gram`: of [nuisances | candidates], in that order.
  ScoreTest(const Eigen::MatrixXd& gram, const Eigen::VectorXd& precision,
            std::vector<Tested> tested);

  /// Numerators from products of the columns with the residual, `products` = [N | J]ᵀ r, of which
  /// `pull` is taken off.
  [[nodiscard]] Eigen::VectorXd numerators(const Eigen::VectorXd& products,
                                           const Eigen::VectorXd& pull) const;
  [[nodiscard]] std::vector<Score> scores(const Eigen::VectorXd& numerators) const;
  /// Largest equivalent of all observable candidates.
  [[nodiscard]] double largest(const Eigen::VectorXd& numerators) const;
  /// Share of candidate k's estimated signature that l could imitate, C², in [0, 1].
  [[nodiscard]] double imitation(std::size_t k, const Eigen::VectorXd& estimate,
                                 std::size_t l) const;
  /// √ of the smallest variance that a number of a candidate can have, I_kk^−½, in scales.
  [[nodiscard]] double error_of(std::size_t k, Eigen::Index number) const;
  /// T of two candidates together, and their numbers.
  struct Pair {
    double statistic = 0.0;
    Eigen::VectorXd first;  ///< in scales
    Eigen::VectorXd second;
  };
  [[nodiscard]] Pair pair(const Eigen::VectorXd& numerators, std::size_t k, std::size_t l) const;

  [[nodiscard]] const std::vector<Tested>& tested() const { return tested_; }
  [[nodiscard]] bool observable(std::size_t k) const { return parts_[k].freedom > 0; }
  /// I
  [[nodiscard]] const Eigen::MatrixXd& information() const { return information_; }
  /// Draws: products of pure noise have the Gram matrix as covariance, and the prior's pull Λ.
  [[nodiscard]] const Eigen::VectorXd& precision() const { return precision_; }

 private:
  struct Part {
    Eigen::MatrixXd inverse;  ///< I_kk⁺, or (I_kk + Λ_k)⁻¹
    int freedom = 0;
    double keep = 0.0;
  };
  /// I_kk + Λ_k
  [[nodiscard]] Eigen::MatrixXd curvature(std::size_t k) const;
  [[nodiscard]] double statistic(std::size_t k, const Eigen::VectorXd& s,
                                 Eigen::VectorXd* estimate) const;
  Eigen::VectorXd precision_;
  std::vector<Tested> tested_;
  Eigen::MatrixXd project_;  ///< JᵀN H⁻¹
  Eigen::MatrixXd information_;
  std::vector<Part> parts_;
};

}  // namespace matterfit::diagnose
