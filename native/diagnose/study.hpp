// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnose/model.hpp"
#include "diagnose/rows.hpp"

namespace matterfit::diagnose {

/// A cause at work, simulated or observed.
struct Active {
  int effect = 0;
  int variant = 0;
  Eigen::VectorXd values;  ///< physical, one a number
};

/// A model that may be extended.
struct State {
  Eigen::VectorXd theta;  ///< natural coordinates
  std::vector<Active> causes;
};

/// Simulations by what they are for.
struct Ledger {
  struct Stage {
    std::string name;
    int runs = 0;
  };
  std::vector<Stage> stages{{"all", 0}};
  std::size_t current = 0;
};

/// The rows that a diagnosis works on, used ones first, held-out ones after them ("stacked"), and
/// simulations as such stacked vectors [m].
class Study {
 public:
  /// `limit`: rows of each kind at most, whole tracks being left out (Rows).
  Study(const Model& model, Eigen::Index limit);
  /// With a selection of its own instead of the captures' marks; its simulations count as the
  /// other's.
  Study(const Study& other, Rows used, Rows held);

  [[nodiscard]] const Model& model() const { return *model_; }
  [[nodiscard]] const Rows& used() const { return used_; }
  [[nodiscard]] const Rows& held() const { return held_; }
  [[nodiscard]] Eigen::Index size() const { return used_.size() + held_.size(); }
  [[nodiscard]] const Eigen::VectorXd& measured() const { return measured_; }
  /// Of the used samples, in the tracks that the limit has left, those of some frames.
  [[nodiscard]] Rows used_in(
      const std::function<bool(int capture, Eigen::Index frame)>& selected) const;
  [[nodiscard]] Eigen::VectorXd stack(const Eigen::VectorXd& motion) const;
  /// The fitted values, nothing added.
  [[nodiscard]] State fitted() const;

  /// Motions of the states without their observations, all in one batch.
  [[nodiscard]] std::vector<std::optional<Motion>> motions(const std::vector<State>& states,
                                                           const Numerics& numerics = {}) const;
  /// What cameras would have seen of a motion in a state, stacked [m].
  [[nodiscard]] Eigen::VectorXd seen(const Motion& motion, const State& state) const;
  /// Both in one.
  [[nodiscard]] std::vector<std::optional<Eigen::VectorXd>> predict(
      const std::vector<State>& states, const Numerics& numerics = {}) const;
  /// Several numerics of one state, in one batch.
  [[nodiscard]] std::vector<std::optional<Eigen::VectorXd>> predict_variants(
      const State& state, const std::vector<Numerics>& variants) const;
  /// Simulations asked for so far, and the same by what they were for, in order.
  [[nodiscard]] int runs() const;
  [[nodiscard]] const std::vector<Ledger::Stage>& stages() const { return ledger_->stages; }
  /// What simulations from now on are for.
  void begin(const std::string& stage) const;

 private:
  Study(const Model& model, Rows used, Rows held, std::shared_ptr<Ledger> ledger);
  const Model* model_;
  Rows used_;
  Rows held_;
  Eigen::VectorXd measured_;
  std::shared_ptr<Ledger> ledger_;
};

/// A candidate: an effect in one shape.
struct Candidate {
  int effect = 0;
  int variant = 0;
  friend bool operator==(const Candidate&, const Candidate&) = default;
};

/// All effects in all their shapes but those that are active.
[[nodiscard]] std::vector<Candidate> candidates_of(const Model& model, const State& state);

/// Derivatives at a state, stacked.
struct Linearised {
  Eigen::VectorXd prediction;
  Eigen::MatrixXd theta;   ///< per Parameter::scale
  Eigen::MatrixXd active;  ///< of the active causes' numbers, one after another, per Number::scale
  struct Column {
    Candidate candidate;
    Eigen::MatrixXd values;  ///< per Number::scale; no columns where it could not be simulated
  };
  std::vector<Column> columns;
};

struct DifferenceOptions {
  double step = 1e-2;  ///< of parameters, in Parameter::scale
  /// Two runs a number where bounds leave room; otherwise one. Candidates, whose derivatives are
  /// first estimates, take one.
  bool central = true;
};

/// By finite differences, all runs in one batch; observations cost none. A run that fails on one
/// side is taken from the other; a parameter both of whose sides fail has a column of 0. Throws
/// Error(kCompute) where the state itself cannot be simulated.
[[nodiscard]] Linearised linearise(const Study& study, const State& state,
                                   const std::vector<Candidate>& candidates,
                                   const DifferenceOptions& options);

/// How the solver's own freedom moves the prediction of a state; rows stacked.
struct Spread {
  Eigen::MatrixXd members;  ///< deviations from the prediction, rows × members [m]
  /// What one standard deviation of each of Numerics' ways to lump masses moves, rows × ways [m].
  Eigen::MatrixXd lumping;
  Eigen::VectorXd bias;  ///< error at the scene's dx extrapolated from two others; may be empty

  /// A solver that makes no error of its own.
  [[nodiscard]] static Spread none(Eigen::Index rows);
  /// At some rows alone.
  [[nodiscard]] Spread at(const std::vector<Eigen::Index>& places) const;
  [[nodiscard]] Spread top(Eigen::Index rows) const;
  [[nodiscard]] Spread bottom(Eigen::Index rows) const;
  /// D, rows × columns [m]: D Dᵀ is the covariance of what is sampled, without the bias.
  [[nodiscard]] Eigen::MatrixXd deviations() const;
};

struct SpreadRuns {
  int members = 24;
  bool lumping = true;
};

/// `members` runs with dx × 0.85 … 1.26, quasi-random offsets in the cell, dt × 1 or ½, other
/// particles; with `lumping` one for each way to lump masses, which is the same in a whole run and
/// so a direction of its own; and two more at 1.26^±1 dx for the bias, taken to be of first order
/// in dx: contact at 7 to 14 cells across a body is. Nothing where the model has no numerics or
/// `members` is 0.
[[nodiscard]] Spread numerical_spread(const Study& study, const State& state,
                                      const SpreadRuns& which);

/// The solver's own error as a covariance U Uᵀ.
struct SolverColumns {
  Eigen::MatrixXd values;   ///< U, rows × columns [m]
  std::vector<int> member;  ///< of the ensemble, that each column was made of; −1: of lumping
};

/// Half of it is what the members themselves span; the other half lets their error be of their size
/// at each time and place of a capture, but of a pattern of its own that changes as slowly as a few
/// cosines over time and straight lines through the body: a few members do not span all that a
/// solver may do wrong, and after a contact, where they differ most, nothing else is to be trusted
/// (a tapered sample covariance by modulated members: Bishop and Hodyss 2009). Lumping has a column
/// for each way. `spread` at the rows.
[[nodiscard]] SolverColumns solver_columns(const Rows& rows, const std::vector<Capture>& captures,
                                           const Spread& spread);

}  // namespace matterfit::diagnose
