// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "fit/data/follow.hpp"
#include "job/fit_captures.hpp"
#include "job/fit_parameters.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::mpm {
struct Gradient;
}

namespace matterfit::job {

/// What the captures of one run would have seen of a simulation.
struct FitObservation {
  std::vector<fit::SimulatedCapture> captures;  ///< in the run's order; empty: was not simulated
  std::vector<int> substeps;                    ///< of each frame
};
/// Of all runs.
using FitOutcome = std::vector<FitObservation>;

/// The substeps of a run's frames throughout a stage: those that the solver chose once, times a
/// power of 2^¼ where the material asks for more or allows less, so that small differences of the
/// parameters are not drowned by another sequence of substeps.
struct FitSteps {
  std::vector<int> substeps;  ///< of each frame; empty: the solver chooses
  double limit = 0.0;         ///< the estimated limit of stability where they were chosen [s]
};

/// Scenes in memory, simulated at any values of the parameters and seen at the captures' own points
/// and times. With a loss between clouds the points are particles of the capture's body, or points
/// of its surface, 8192 at most.
class FitModel {
 public:
  struct Options {
    FitDoc::Loss loss = FitDoc::Loss::kTracks;
    mpm::SimdTarget target = mpm::SimdTarget::kAuto;
    int threads = 1;
    double memory_limit_gb = 8.0;
  };
  /// Which runs are simulated, and for how long.
  struct Scope {
    std::vector<double> until;  ///< [s] of each run; negative: not simulated
    bool solver_steps = false;  ///< the solver chooses its substeps, as it does outside of a fit
  };

  /// `scenes` one a run; both are borrowed but for the scenes.
  FitModel(const std::vector<FitRun>& runs, std::vector<mpm::Scene> scenes,
           const FitParameters& parameters, const Options& options, const Interrupter& interrupter);
  ~FitModel();
  FitModel(const FitModel&) = delete;
  FitModel& operator=(const FitModel&) = delete;

  [[nodiscard]] const mpm::Scene& scene(std::size_t run) const;
  [[nodiscard]] int threads() const { return options_.threads; }
  [[nodiscard]] const std::vector<FitSteps>& steps() const { return steps_; }
  void set_steps(std::vector<FitSteps> steps) { steps_ = std::move(steps); }
  /// From here on the solver chooses.
  void forget_steps() { steps_.assign(models_.size(), {}); }
  /// The substeps of an evaluation that the solver chose, at these values.
  [[nodiscard]] std::vector<FitSteps> steps_of(std::span<const double> values,
                                               const FitOutcome& outcome) const;
  /// From here on no evaluation takes fewer substeps than these values ask for, nor than `before`
  /// (refinements() of an earlier point of the same search; empty: none) unless half as many would
  /// do: a search whose substeps change with every step compares costs that cannot be compared.
  void settle(std::span<const double> values, std::span<const int> before);
  /// Of a run whose substeps were never settled.
  static constexpr int kUnsettled = -64;
  /// The power of 2^¼ by which settle() multiplied the substeps of each run.
  [[nodiscard]] const std::vector<int>& refinements() const { return refinements_; }

  /// Simulates at each of the points (physical values), side by side with one thread each, as many
  /// as the memory limit holds, one alone with all of them. Nothing where a simulation could not be
  /// completed; failure() then says why. Equal bits for any number of threads. `progress` is told
  /// the fraction done, from any thread. Throws Error(kCancelled).
  [[nodiscard]] std::vector<std::optional<FitOutcome>> evaluate(
      const std::vector<std::vector<double>>& points, const Scope& scope,
      const std::function<void(double)>& progress = {}) const;
  /// Whether pull_back() can tell: not with a loss between clouds, whose nearest neighbours change,
  /// nor by where a body is placed or when a recording began, nor where the scenes have no adjoint
  /// or contacts of several bodies follow a material that is fitted.
  [[nodiscard]] bool has_gradient() const;
  /// The derivative by each parameter (physical values) of Σ bar·x over what the captures see of a
  /// simulation: `bars` run by run and capture by capture, (T, N), none of a run that is not
  /// simulated. By the adjoint (mpm/gradient.hpp), with substeps held, and with the share of total
  /// Lagrangian velocities that is smoothed. Nothing where the simulation could not be completed,
  /// or a gigabyte does not hold its record. Equal bits for any number of threads. Throws
  /// Error(kCancelled).
  [[nodiscard]] std::optional<std::vector<double>> pull_back(
      const std::vector<double>& values, const Scope& scope,
      const std::vector<std::vector<Points>>& bars,
      const std::function<void(double)>& progress = {}) const;
  [[nodiscard]] const std::string& failure() const { return failure_.message; }
  /// It was refused for what the document says.
  [[nodiscard]] bool failed_by_input() const { return failure_.by_input; }

 private:
  struct RunModel;
  struct Trial;
  struct Failure {
    std::string message;
    bool by_input = false;
  };
  /// What the values of a run do by way of contacts that follow the material.
  void add_through_contacts(std::size_t run, std::span<const double> values,
                            const mpm::Gradient& gradient, std::span<double> sum) const;
  /// The power for this scene.
  [[nodiscard]] int refined(std::size_t run, const mpm::Scene& scene) const;
  [[nodiscard]] mpm::Simulation::Options simulation_options() const;
  /// A run at these values, without its substeps.
  [[nodiscard]] Trial trial(std::size_t run, std::span<const double> values, const Scope& scope,
                            Arena& arena) const;
  std::optional<FitObservation> simulate(std::size_t run, std::span<const double> values,
                                         const Scope& scope, const std::shared_ptr<Arena>& arena,
                                         const std::function<void()>& tick, Failure& failure) const;

  const std::vector<FitRun>& runs_;
  const FitParameters& parameters_;
  Options options_;
  const Interrupter& interrupter_;
  std::vector<std::unique_ptr<RunModel>> models_;
  std::vector<FitSteps> steps_;
  std::vector<int> refinements_;  ///< least power of 2^¼ of each run
  std::size_t bytes_ = 0;         ///< that one simulation takes, of the largest run
  mutable Failure failure_;
};

}  // namespace matterfit::job
