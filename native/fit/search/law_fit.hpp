// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "fit/numerics/uncertainty.hpp"
#include "fit/search/law_state.hpp"
#include "fit/search/problems.hpp"
#include "fit/search/search_phases.hpp"
#include "fit/search/search_progress.hpp"
#include "fit/search/stages.hpp"
#include "fit/search/start_search.hpp"

namespace matterfit::fit {

/// The fit of one law, one step at a time: the initial motion in closed form; where the start is
/// poor the momentum balance of the tracks and, if that leaves it poor, a scan of simulations; then
/// windows that grow, at the coarsest level that shows the motion (the whole clip at once at others
/// than the first); then the whole clip, level by level to the finest, each led by the Jacobian of
/// the one before. Where the first of these stages ends far off, the scan is made once more and the
/// stage again. In each stage Levenberg–Marquardt with substeps held. SearchPhases has the order of
/// all this; here is what each step does to the simulations.
class LawFit final : private SearchWork {
 public:
  /// Builds the scenes at the document's resolution. Throws Error(kInput), Error(kCancelled).
  LawFit(SearchSetup setup, const Interrupter& interrupter, std::vector<std::string>& statements);
  ~LawFit() override;

  [[nodiscard]] const Parameters& parameters() const { return problems_.parameters(); }
  /// The scenes of the runs at the document's resolution.
  [[nodiscard]] const std::vector<mpm::Scene>& scenes() const { return problems_.scenes(); }
  [[nodiscard]] const std::vector<Run>& runs() const { return problems_.runs(); }
  /// The model of those scenes.
  [[nodiscard]] const Model& model() { return problems_.model(1.0); }
  [[nodiscard]] Loss loss() const { return problems_.setup().options.loss; }
  [[nodiscard]] LawState start() const;
  /// In the last stage, with nothing looked for before it.
  [[nodiscard]] LawState at_last_stage(std::vector<double> values) const;

  /// SearchPhases::advance(). Throws Error(kCancelled) too.
  void advance(LawState& state, std::vector<SearchStep>& history) {
    phases_.advance(state, history);
  }

  /// At the end: standard errors and correlations; linearises once more.
  [[nodiscard]] Uncertainty uncertainty(const LawState& state);
  /// Those of the parameters from `first` on that the capture excites (fit/numerics/excited.hpp),
  /// at the values where a stage begins. Throws Error(kCompute) where it cannot be simulated.
  [[nodiscard]] std::vector<std::size_t> excited(const LawState& state, std::size_t first);
  /// Their mean; infinite where the stage has compared nothing yet.
  [[nodiscard]] double mean_missed(const LawState& state) override;
  /// Whether the present stage misses what it compares by more than noise and grid explain.
  [[nodiscard]] bool is_far(const LawState& state) override;
  /// Compares at the state's values, with no step: begins the stage where it is not begun. Throws
  /// as advance() does.
  void compare(LawState& state);
  /// After compare() or an iteration: derivatives of half the sum of squared residuals that the
  /// stage compares, by the weights of a body's published law; nothing where they are not known.
  [[nodiscard]] std::optional<std::vector<double>> published_slope(const LawState& state,
                                                                   const std::string& body);
  /// Distances [m] of the samples that the present stage compares, at the state's values.
  [[nodiscard]] std::vector<double> distances(const LawState& state);
  /// All runs and frames, held-out ones too, as a simulation outside of the fit has them; nothing
  /// if it could not be completed (`failure`). `fitted`: of values that were found; else
  /// Error(kInput) if the document is why it could not.
  [[nodiscard]] std::optional<Outcome> predict(const LawState& state, bool fitted,
                                               std::string& failure);

  std::function<void(const SearchProgress&)> report;

 private:
  struct Context;

  void find_start(LawState& state) override;
  [[nodiscard]] bool skip_level(LawState& state) override;
  [[nodiscard]] bool rescan(LawState& state) override;
  [[nodiscard]] std::optional<Failure> begin_stage(LawState& state) override;
  [[nodiscard]] std::optional<LawState> iterated(const LawState& state,
                                                 std::vector<SearchStep>& history,
                                                 std::string& failure) override;
  [[nodiscard]] double rms_missed(const LawState& state) override;
  [[nodiscard]] double far() override { return problems_.far(); }

  void settle(LawState& state);
  /// Has the residuals at the search's point with the substeps that it takes; false if that cannot
  /// be simulated.
  [[nodiscard]] bool observe(LawState& state);
  /// Goes back to the nearest point of the stage and ends it there. False if that cannot be
  /// simulated.
  [[nodiscard]] bool end_at_nearest(LawState& state);
  /// The substeps of a level at the start of a stage; nothing if it cannot be run.
  [[nodiscard]] std::optional<std::vector<RunSteps>> fix(double level, LawState& state,
                                                         const Window& window, Failure& failure);
  Context& context(const LawState& state);
  [[nodiscard]] std::vector<Parameter> stage_parameters(const LawState& state) const;
  void tell(const LawState& state, const std::string& what, double part, double rms) const;
  /// tell() of the state's stage.
  void tell_stage(const LawState& state, double part, double rms) const;
  void tell(const LawState& state, SearchProgress said, double part) const;

  std::vector<std::string>& statements_;
  SearchProblems problems_;
  std::vector<SearchStage> stages_;
  StartSearch starts_;   ///< of the two above
  SearchPhases phases_;  ///< of the stages, and of this object
  std::unique_ptr<Context> context_;
};

}  // namespace matterfit::fit
