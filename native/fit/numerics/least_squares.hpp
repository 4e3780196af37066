// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fit/numerics/parameter.hpp"

namespace matterfit::fit {

/// What is to be made small: residuals divided by their standard deviation, so that half their sum
/// of squares is minus the logarithm of the likelihood. Priors are added by the optimiser.
class Problem {
 public:
  virtual ~Problem() = default;
  /// Residuals at each of the points (natural coordinates, one parameter a row), all at once so
  /// that they may be computed side by side. Nothing where the simulation could not be completed
  /// (unstable): for the optimiser a step that is refused. Equally many residuals each time;
  /// entries that are not observed are 0. Throws Error(kCancelled).
  virtual std::vector<std::optional<Eigen::VectorXd>> evaluate(
      const std::vector<Eigen::VectorXd>& points) = 0;
  /// A cheaper problem with as many residuals that change with the parameters nearly as these do
  /// (the same simulation at a coarser resolution); null: none. The Jacobian is taken from it until
  /// that leads no farther.
  virtual Problem* stand_in() { return nullptr; }
  /// The transpose of the Jacobian at `point` times `weights`, one a residual, by an adjoint:
  /// nothing where there is none or it failed. Throws Error(kCancelled).
  virtual std::optional<Eigen::VectorXd> transposed(const Eigen::VectorXd& /*point*/,
                                                    const Eigen::VectorXd& /*weights*/) {
    return std::nullopt;
  }
  /// What transposed() takes, in evaluations of a batch; 0: there is none.
  [[nodiscard]] virtual double transposed_cost() const { return 0.0; }
  /// How many of these residuals count as independent; 0: not known.
  [[nodiscard]] virtual double effective(const Eigen::VectorXd&) const { return 0.0; }
  /// The block of each residual: parts of the data that know little of each other, for errors from
  /// how far they disagree. Empty: not known.
  [[nodiscard]] virtual std::vector<std::uint32_t> blocks() const { return {}; }
};

struct LeastSquaresOptions {
  int iterations = 30;
  double huber = 0.0;  ///< residuals beyond this many standard deviations count linearly; 0: off
  double step_tolerance = 1e-4;  ///< largest |Δξ|/scale of an accepted step that ends the search
  /// Relative decrease that ends it; more, up to 1e-4, where that much moves no parameter by a
  /// tenth of its standard error (Problem::effective()).
  double cost_tolerance = 1e-6;
  double difference = 1e-2;  ///< step of the finite differences, in units of Parameter::scale
  /// Where one-sided ones lead no farther, an adjoint or central ones are tried.
  bool thorough = true;
};

/// One accepted or refused step, for loss curves and logs.
struct LeastSquaresStep {
  int iteration = 0;  ///< 0: the start
  double cost = 0.0;  ///< ½ Σ ρ(r²) + priors, after the step; as before it where it was refused
  double damping = 0.0;
  bool accepted = false;
};

/// All that goes on from one iteration to the next, so that a fit can be written to disk and goes
/// on to the same bits.
struct LeastSquaresState {
  Eigen::VectorXd point;     ///< natural coordinates, the best so far
  Eigen::VectorXd residual;  ///< there, without priors; empty before the first iteration
  double cost = 0.0;
  double damping = 1e-2;
  int iteration = 0;  ///< steps accepted
  int evaluations = 0;
  bool finished = false;
  bool converged = false;  ///< finished because nothing is left to gain, or next to nothing
  std::string reason;      ///< why it ended, a sentence
  bool own = false;        ///< the stand-in leads no farther: Jacobians are the problem's own
  /// Where the Jacobian was taken that the next iteration uses again; empty: it makes its own.
  Eigen::VectorXd anchor;
  bool central = false;  ///< that one is of central differences
  /// Points stepped to since then: each has brought the Jacobian up to date.
  std::vector<Eigen::VectorXd> trail;
  /// Where an adjoint has corrected it: 0 at the anchor, i at the i-th point of the trail.
  std::vector<int> corrected;
  int vain = 0;  ///< corrections of this search that led nowhere
  /// The Jacobian of the last linearisation, residuals × parameters. With an anchor it goes into
  /// the next iteration, which makes it again, to the same bits, where it is empty.
  Eigen::MatrixXd jacobian;
  /// Parameters of that linearisation whose column is 0 because every evaluation beside the point
  /// failed. Goes with the Jacobian.
  std::vector<std::uint8_t> unknown;
  std::vector<LeastSquaresStep> history;

  /// The next iteration makes a Jacobian of its own.
  void forget_slopes() {
    anchor.resize(0);
    central = false;
    trail.clear();
    corrected.clear();
  }
  void finish(bool has_converged, std::string why) {
    finished = true;
    converged = has_converged;
    reason = std::move(why);
  }
};

/// Whether the residual is observed: it or its slopes are not 0. The state has a Jacobian.
[[nodiscard]] inline bool is_observed(const LeastSquaresState& state, Eigen::Index row) {
  return state.residual[row] != 0.0 || !state.jacobian.row(row).isZero(0.0);
}

/// Levenberg–Marquardt within bounds (projected, with an active set), Marquardt's scaling by the
/// diagonal, priors as further residuals, Huber weights (iteratively reweighted). Jacobian by
/// finite differences, away from a bound that is near. An evaluation that fails makes the step
/// shorter. No step takes a logarithmic coordinate farther than a factor ten, and what the data do
/// not know to 30 scales stays. One-sided differences end up to half their step off where the
/// residuals are large and curved; central ones do not. With a stand-in its Jacobian leads to where
/// its own gradient against the true residuals is 0; from there on the problem's own is used. A
/// Jacobian is kept while steps gain what it promises, and each brings it up to date with what the
/// residuals did (Broyden's update, in units of the scales). Where it leads no farther and an
/// adjoint costs less than another one, it is corrected by the exact gradient (the adjoint Broyden
/// update), unless two such corrections have led nowhere. References: Nocedal and Wright,
/// Numerical Optimization, ch. 10 and 11; Madsen, Nielsen and Tingleff 2004; space mapping: Bandler
/// et al. 2004; Schlenkrich, Griewank and Walther 2010.
class LeastSquares {
 public:
  LeastSquares(std::vector<Parameter> parameters, LeastSquaresOptions options);
  [[nodiscard]] const std::vector<Parameter>& parameters() const { return parameters_; }
  [[nodiscard]] LeastSquaresState start() const;  ///< at the parameters' start values
  /// One iteration: linearise, try steps until one is accepted. Sets `finished` with the reason
  /// when it converged, came to the limit of iterations, or no step helps. Throws Error(kCompute)
  /// if the starting point itself cannot be evaluated. Where it throws the state is as before.
  void iterate(Problem& problem, LeastSquaresState& state) const;
  /// Linearises for the covariance: with a stand-in the kept Jacobian, if there is one that no
  /// adjoint has corrected; else at `state.point` with central differences.
  void linearise(Problem& problem, LeastSquaresState& state) const;

 private:
  std::vector<Parameter> parameters_;
  LeastSquaresOptions options_;
};

}  // namespace matterfit::fit
