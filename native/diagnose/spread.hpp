// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnose/study.hpp"

namespace matterfit::diagnose {

/// How the solver's own freedom moves the prediction of a state; rows stacked.
struct Spread {
  Eigen::MatrixXd members;  ///< deviations from the prediction, rows × members [m]
  /// Deviations by one standard deviation of what errs in directions of its own, rows × directions
  /// [m]: Numerics' ways to lump masses, and the rigid motion in each Model::contact_frames().
  Eigen::MatrixXd directions;
  Eigen::VectorXd bias;  ///< error at the scene's dx extrapolated from two others; may be empty

  /// A solver that makes no error of its own.
  [[nodiscard]] static Spread none(Eigen::Index rows);
  /// Whether anything was learnt of the solver's error.
  [[nodiscard]] bool known() const { return members.cols() > 0; }
  /// At some rows alone.
  [[nodiscard]] Spread at(const std::vector<Eigen::Index>& places) const;
  [[nodiscard]] Spread top(Eigen::Index rows) const;
  [[nodiscard]] Spread bottom(Eigen::Index rows) const;
  /// D, rows × columns [m]: D Dᵀ is the covariance of what is sampled, without the bias.
  [[nodiscard]] Eigen::MatrixXd deviations() const;
};

struct SpreadRuns {
  int members = 24;
  bool directions = true;
  /// Whether deviations lose what the parameters take up (bring_near); an estimate of the
  /// parameters' own errors needs it.
  bool adapted = true;
};

/// `members` runs with dx × 0.85 … 1.26, quasi-random offsets in the cell, dt × 1 or ½, other
/// particles, other contacts; with `directions` one for each way to lump masses, which is the same
/// in a whole run and so a direction of its own, and the frames of contact; and two more at 1.26^±1
/// dx for the bias, taken to be of first order in dx: contact at 7 to 14 cells across a body is.
/// Nothing where the model has no numerics or `members` is 0. `theta`: derivatives at the state, in
/// scales; the model's corrections are fitted to each run first.
[[nodiscard]] Spread numerical_spread(const Study& study, const State& state,
                                      const Eigen::MatrixXd& theta, const SpreadRuns& which);

/// The solver's own error as a covariance U Uᵀ.
struct SolverColumns {
  Eigen::MatrixXd values;   ///< U, rows × columns [m]
  std::vector<int> member;  ///< of the ensemble, that each column was made of; −1: a direction
};

/// Half of it is what the members themselves span; the other half lets their error be of their size
/// at each time and place of a capture, but of a pattern of its own that changes as slowly as a few
/// cosines over time and straight lines through the body: a few members do not span all that a
/// solver may do wrong, and after a contact, where they differ most, nothing else is to be trusted
/// (a tapered sample covariance by modulated members: Bishop and Hodyss 2009). Each direction has
/// a column. `spread` at the rows.
[[nodiscard]] SolverColumns solver_columns(const Rows& rows, const std::vector<Capture>& captures,
                                           const Spread& spread);

}  // namespace matterfit::diagnose
