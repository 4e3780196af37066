// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fit/model/capture_problem.hpp"
#include "fit/model/predictor.hpp"
#include "fit/numerics/uncertainty.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_equation_start.hpp"
#include "job/fit_flow_start.hpp"
#include "job/fit_report.hpp"
#include "job/fit_start_limit.hpp"
#include "job/fit_state.hpp"

namespace matterfit::job {

/// What the fit of one law needs to know.
struct FitSetup {
  const FitDoc* fit = nullptr;
  const fit::Experiment* experiment = nullptr;
  /// One a run: its scene with this law's material.
  std::vector<fit::SceneBuilder> builders;
  material::Law law = material::Law::kFixedCorotated;
  std::vector<fit::ParameterSpec> parameters;
  mpm::SimdTarget target = mpm::SimdTarget::kAuto;
  int threads = 0;
  double memory_limit_gb = 8.0;
};

/// Where a search stands, for progress.
struct FitReport {
  std::string stage;
  double fraction = 0.0;  ///< of this law's fit, a guess
  int iteration = 0;
  double rms = 0.0;  ///< [m]; NaN: not known
};

/// As a label of progress, of 63 bytes at most (capi/matterfit.h): where that is too little the
/// iteration is left out, then the law. `law` empty: the only one.
[[nodiscard]] std::string fit_label(const FitReport& report, const std::string& law);

/// The fit of one law, one step at a time: the initial motion in closed form; where the start is
/// poor the momentum balance of the tracks and, if that leaves it poor, a scan of simulations; then
/// windows that grow, at the coarsest level that shows the motion (the whole clip at once at others
/// than the first); then the whole clip, level by level to the finest, each led by the Jacobian of
/// the one before. Where the first of these stages ends far off, the scan is made once more and the
/// stage again. In each stage Levenberg–Marquardt with substeps held.
class LawFit {
 public:
  /// Builds the scenes at the document's resolution. Throws Error(kInput), Error(kCancelled).
  LawFit(FitSetup setup, const Interrupter& interrupter, std::vector<std::string>& statements);
  ~LawFit();
  LawFit(const LawFit&) = delete;
  LawFit& operator=(const LawFit&) = delete;

  [[nodiscard]] const fit::Parameters& parameters() const { return predictor_.parameters(); }
  /// The scenes of the runs at the document's resolution.
  [[nodiscard]] const std::vector<mpm::Scene>& scenes() const { return predictor_.scenes(); }
  [[nodiscard]] LawState start() const;
  /// In the last stage, with nothing looked for before it.
  [[nodiscard]] LawState at_last_stage(std::vector<double> values) const;

  /// One step: the start, or one iteration. Adds lines to `history`. Throws Error(kCompute) if the
  /// simulation at the start cannot be completed, Error(kInput) if the document is why,
  /// Error(kCancelled); the state is then as before. Where a later one cannot be completed the
  /// search ends with the values so far.
  void advance(LawState& state, std::vector<Json>& history);

  /// At the end: standard errors and correlations; linearises once more.
  [[nodiscard]] fit::Uncertainty uncertainty(const LawState& state);
  /// Of the parameters from `first` on, those that the capture excites (fit/numerics/excited.hpp)
  /// at the values where a stage begins. Throws Error(kCompute) where it cannot be simulated.
  [[nodiscard]] std::vector<std::size_t> excited(const LawState& state, std::size_t first);
  /// Their mean; infinite where the stage has compared nothing yet.
  [[nodiscard]] double mean_missed(const LawState& state);
  /// Whether the present stage misses what it compares by more than noise and grid explain.
  [[nodiscard]] bool is_far(const LawState& state);
  /// Distances [m] of the samples that the present stage compares, at the state's values.
  [[nodiscard]] std::vector<double> distances(const LawState& state);
  /// Errors over all runs and frames, held-out ones too, as a simulation outside of the fit has
  /// them; nothing if it could not be completed (`failure`). `fitted`: of values that
  /// were found; else Error(kInput) if the document is why it could not.
  [[nodiscard]] std::optional<ErrorPool> errors(const LawState& state, bool fitted,
                                                std::string& failure);

  std::function<void(const FitReport&)> report;

 private:
  struct Stage {
    std::string name;
    double level = 1.0;
    std::optional<double> stand_in;  ///< the level that Jacobians come from at first
    fit::Window window;
    bool whole = false;  ///< its window is the whole clip
    bool last = false;
  };
  struct Context;

  /// Where a search may begin.
  struct Start {
    std::vector<double> values;
    double mean = 0.0;     ///< distance from the capture [m]
    bool scanned = false;  ///< it was poor, and so was what the momentum balance gives
    std::string statement;
  };

  void begin(LawState& state);
  /// Replaces the material of a start by one that misses less: of the momentum balance or, if that
  /// is poor, of a scan.
  void find_material(LawState& state, const fit::Window& window, const StartLimit& limit,
                     const EquationStart& balance, Start& start);
  /// A start in the nearest class of flow; the second one is for a search that ends far off.
  void take_flow(LawState& state, std::vector<FlowFound> found, Start& start) const;
  /// `values` with the law's parameters of `material`.
  [[nodiscard]] std::vector<double> with_law_of(std::vector<double> values,
                                                const std::vector<double>& material) const;
  [[nodiscard]] bool at_first_level(const LawState& state) const;
  /// At the end of the first level's last stage, far off, with two starts: goes to the second, and
  /// after that back to the first if the second ended farther off. True where a stage begins anew.
  [[nodiscard]] bool try_other_start(LawState& state);
  /// To where the first of two starts ended, at the end of its last stage; false if it was no
  /// second that was searched from.
  [[nodiscard]] bool back_to_first_start(LawState& state) const;
  /// Whether the present stage is one after which rescan() may be due.
  [[nodiscard]] bool may_rescan(const LawState& state) const;
  /// Looks once more along each parameter from where the first stage ended (where the first motion
  /// was not known, the first level): it may lie in a wrong valley. True if something better was
  /// found.
  [[nodiscard]] bool rescan(LawState& state);
  /// Begins with a finer level where the state's one does not show the motion: where what the finer
  /// one makes of the same values differs by much of what they are off. A coarse grid is stiff and
  /// viscous by itself, and a search there makes up for it. True if it does.
  bool skip_level(LawState& state);
  /// Of simulations at a level (that of the first stage) [m].
  [[nodiscard]] std::vector<double> mean_distances(LawState& state,
                                                   const std::vector<std::vector<double>>& points,
                                                   const fit::Window& window, double level);
  [[nodiscard]] std::vector<double> mean_distances(LawState& state,
                                                   const std::vector<std::vector<double>>& points,
                                                   const fit::Window& window);
  /// mean_distances() of a scan; infinite, without a simulation, beyond the limit.
  [[nodiscard]] std::vector<double> start_distances(LawState& state, const StartLimit& limit,
                                                    const std::vector<std::vector<double>>& points,
                                                    const fit::Window& window);
  /// Where a finer level begins: with the material of the coarser one, or with one of those that
  /// were tried as a start, whichever is nearest there. A coarse grid is viscous by itself, and a
  /// fit there makes up for it.
  void choose_material(LawState& state);
  /// The mean distance beyond which a start is poor, and that beyond which an end is far off [m].
  [[nodiscard]] double poor() const;
  [[nodiscard]] double far() const;
  /// What clouds of one body miss each other by in the mean [m].
  [[nodiscard]] double alike() const;
  void set_stage(LawState& state);
  void end_stage(LawState& state);
  /// Notes every few iterations how far the capture is missed.
  void take_standing(LawState& state, int iterations_before);
  void settle(LawState& state);
  [[nodiscard]] const fit::Model& model(double level) { return predictor_.model(level); }
  [[nodiscard]] const std::vector<fit::Run>& runs() const { return predictor_.runs(); }
  /// The residuals of all used samples at a level.
  [[nodiscard]] fit::CaptureProblem problem(double level, const fit::Window& window,
                                            const std::vector<fit::Parameter>& parameters);
  [[nodiscard]] fit::CaptureProblem problem(double level, const fit::Window& window) {
    return problem(level, window, parameters().parameters());
  }
  /// The substeps of a level at the start of a stage; nothing if it cannot be run.
  [[nodiscard]] std::optional<std::vector<fit::RunSteps>> fix(double level, LawState& state,
                                                              const fit::Window& window,
                                                              fit::Failure& failure);
  Context& context(const LawState& state);
  [[nodiscard]] std::vector<fit::Parameter> stage_parameters(const LawState& state) const;
  /// What a coarser grid adds to the residuals of the last stage at its end; nothing where it
  /// cannot be told (the grid cannot be made; the simulation could not be completed).
  [[nodiscard]] std::optional<Eigen::VectorXd> coarser(const LawState& state);
  void tell(const LawState& state, const std::string& stage, double part, double rms) const;

  FitSetup setup_;
  const Interrupter& interrupter_;
  std::vector<std::string>& statements_;
  fit::Predictor predictor_;
  std::vector<Stage> stages_;
  std::unique_ptr<Context> context_;
  /// The best of the points that mean_distances() tried last [m], for progress.
  double told_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace matterfit::job
