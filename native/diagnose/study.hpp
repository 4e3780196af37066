// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
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
    bool search = false;  ///< counts for search_work()
    double work = 0.0;    ///< Motion::work of them, 1 of what could not be simulated
  };
  std::vector<Stage> stages{{"all", 0}};
  std::size_t current = 0;
  bool cut = false;  ///< searches were ended before they were done
};

/// The rows that a diagnosis works on, used ones first, held-out ones after them ("stacked"), and
/// simulations as such stacked vectors [m].
class Study {
 public:
  /// Which rows of a prediction are looked at; the others may be anything finite.
  enum class Wanted : std::uint8_t { kAll, kUsed };
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
  /// The used samples of some frames, in the tracks that the limit has left.
  [[nodiscard]] Rows used_in(
      const std::function<bool(int capture, Eigen::Index frame)>& selected) const;
  [[nodiscard]] Eigen::VectorXd stack(const Eigen::VectorXd& motion) const;
  /// The fitted values, nothing added.
  [[nodiscard]] State fitted() const;

  /// Motions of the states without their observations, all in one batch.
  [[nodiscard]] std::vector<std::optional<Motion>> motions(const std::vector<State>& states,
                                                           Wanted wanted = Wanted::kAll) const;
  /// What cameras would have seen of a motion in a state, stacked [m].
  [[nodiscard]] Eigen::VectorXd seen(const Motion& motion, const State& state) const;
  /// Both in one.
  [[nodiscard]] std::vector<std::optional<Eigen::VectorXd>> predict(
      const std::vector<State>& states, Wanted wanted = Wanted::kAll) const;
  /// Each state in its numerics, in one batch. `until`: Point::until of each; empty: of all rows.
  [[nodiscard]] std::vector<std::optional<Eigen::VectorXd>> predict_variants(
      const std::vector<State>& states, const std::vector<Numerics>& variants,
      const std::vector<std::vector<double>>& until = {}) const;
  /// Simulations asked for so far, and the same by what they were for, in order.
  [[nodiscard]] int runs() const;
  /// The work of the stages that began with begin_search(), in simulations of the fitted values:
  /// one with ten times the stiffness counts three times.
  [[nodiscard]] double search_work() const;
  /// Ledger::cut
  [[nodiscard]] bool cut() const { return ledger_->cut; }
  void mark_cut() const { ledger_->cut = true; }
  [[nodiscard]] const std::vector<Ledger::Stage>& stages() const { return ledger_->stages; }
  /// Names the stage that simulations from now on count for; begin_search(): of a search, whose
  /// work is limited. A stage is the one or the other.
  void begin(const std::string& stage) const { begin(stage, false); }
  void begin_search(const std::string& stage) const { begin(stage, true); }

 private:
  Study(const Model& model, Rows used, Rows held, std::shared_ptr<Ledger> ledger);
  void begin(const std::string& stage, bool search) const;
  /// Simulates, and writes it into the ledger.
  [[nodiscard]] std::vector<std::optional<Motion>> simulate(const std::vector<Point>& points) const;
  [[nodiscard]] Point point_of(const State& state, Wanted wanted) const;
  const Model* model_;
  Rows used_;
  Rows held_;
  Eigen::VectorXd measured_;
  std::vector<double> used_until_;  ///< Point::until of the used rows
  std::vector<double> until_;       ///< and of all
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
    /// Per Number::scale, of the used rows; no columns where it could not be simulated.
    Eigen::MatrixXd values;
  };
  std::vector<Column> columns;
};

struct DifferenceOptions {
  double step = 1e-2;  ///< of parameters, in Parameter::scale
  /// Two runs a number where bounds leave room; otherwise one. Candidates, whose derivatives are
  /// first estimates, take one.
  bool central = true;
  std::vector<Eigen::Index> left_out;  ///< parameters, whose columns stay 0
  std::size_t numbers = SIZE_MAX;      ///< of a candidate: the first ones, so many at most
  Study::Wanted wanted = Study::Wanted::kAll;
};

/// Finite differences, those of the state and those of the candidates in a batch each.
/// Observations cost no run where simulations do not follow the recordings. A run that fails on one
/// side is taken from the other; a parameter both of whose sides fail has a column of 0. Throws
/// Error(kCompute) where the state itself cannot be simulated.
[[nodiscard]] Linearised linearise(const Study& study, const State& state,
                                   const std::vector<Candidate>& candidates,
                                   const DifferenceOptions& options);

/// The same with the columns of nuisances of known times taken from `known` (θ first, in scales)
/// where it has any: they are the dearest and change least.
[[nodiscard]] Linearised linearise_keeping(const Study& study, const State& state,
                                           const std::vector<Candidate>& candidates,
                                           DifferenceOptions options, const Eigen::MatrixXd& known);

/// Takes the model's corrections back to 0, to first order, and out of what may move: what an exact
/// solver would have to explain. `theta`: derivatives at the state, in scales.
void hold_corrections(const Model& model, const State& state, Eigen::VectorXd& prediction,
                      Eigen::MatrixXd& theta);

}  // namespace matterfit::diagnose
