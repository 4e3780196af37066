// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "fit/data/follow.hpp"
#include "fit/data/losses.hpp"
#include "fit/model/experiment.hpp"
#include "fit/model/filming.hpp"
#include "fit/model/parameters.hpp"
#include "fit/model/step_plan.hpp"
#include "fit/model/variation.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::mpm {
struct Gradient;
}

namespace matterfit::fit {

/// What the captures of one run would have seen of a simulation.
struct Observation {
  std::vector<SimulatedCapture> captures;     ///< in the run's order; empty: was not simulated
  std::vector<int> substeps;                  ///< of each frame
  std::vector<std::vector<double>> renewals;  ///< the same (mpm::FrameReport)
};
/// What was observed in all runs.
using Outcome = std::vector<Observation>;

/// What is simulated: values of the parameters (physical), and what is otherwise.
struct Query {
  std::vector<double> values;
  Variation variation = {};
};

/// Which runs are simulated, for how long, and how they are stepped.
struct Scope {
  std::vector<double> until;       ///< [s] of each run; negative: not simulated
  const StepPlan* plan = nullptr;  ///< null: the solver chooses, as it does outside of a fit
  bool velocities = false;         ///< are seen too
  /// Borrowed; null: no images are drawn. Its run is simulated to the last view at least.
  const Filming* filming = nullptr;
};
/// Every run that has captures, to its end, as the solver chooses.
[[nodiscard]] Scope whole_scope(const std::vector<Run>& runs);

/// Why a simulation could not be completed.
struct Failure {
  std::string message;
  bool by_input = false;  ///< for what the document says
};

/// One outcome a query; nothing where its simulation could not be completed: `failure` is the last
/// one's.
struct Evaluation {
  std::vector<std::optional<Outcome>> outcomes;
  Failure failure;
};

/// Scenes of one resolution in memory, simulated at any values of the parameters and seen at the
/// captures' own points and times, without rounding. With a loss between clouds the points are
/// particles of the capture's body, or points of its surface, 8192 at most. Nothing that is asked
/// changes it: it may be asked from any thread.
class Model {
 public:
  struct Options {
    Loss loss = Loss::kTracks;
    mpm::SimdTarget target = mpm::SimdTarget::kAuto;
    int threads = 1;  ///< below 1: as many as the machine has
    double memory_limit_gb = 8.0;
  };

  /// `scenes` one a run; all is borrowed but for the scenes.
  Model(const std::vector<Run>& runs, std::vector<mpm::Scene> scenes, const Parameters& parameters,
        const Options& options, const Interrupter& interrupter);
  ~Model();
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;

  [[nodiscard]] std::size_t runs() const { return models_.size(); }
  [[nodiscard]] const mpm::Scene& scene(std::size_t run) const;
  /// What bodies of a run's scene() are drawn by in place of their particles.
  [[nodiscard]] std::span<const OwnSplats> own(std::size_t run) const;
  /// The scene of a run as it is simulated at these values.
  [[nodiscard]] mpm::Scene scene_at(std::span<const double> values, std::size_t run) const;
  [[nodiscard]] int threads() const { return options_.threads; }
  [[nodiscard]] mpm::SimdTarget target() const { return options_.target; }

  /// The camera of a view of run 0 as it stands.
  [[nodiscard]] splat::Camera camera_of(std::span<const double> values, const View& view) const;

  /// The plan that an evaluation of these values was stepped by, which the solver chose.
  [[nodiscard]] StepPlan plan_of(std::span<const double> values, const Outcome& outcome) const;
  /// StepPlan::settle() of every run that the plan holds, by these values. `before`: refinements of
  /// an earlier point of the same search; empty: none.
  void settle(StepPlan& plan, std::span<const double> values, std::span<const int> before) const;

  /// Simulates each of the queries, side by side with one thread each, as many as the memory limit
  /// holds, one alone with all of them. Equal bits for any number of threads. `progress` is told
  /// the fraction done, from any thread. Throws Error(kCancelled).
  [[nodiscard]] Evaluation evaluate(const std::vector<Query>& queries, const Scope& scope,
                                    const std::function<void(double)>& progress = {}) const;
  [[nodiscard]] Evaluation evaluate(const std::vector<std::vector<double>>& points,
                                    const Scope& scope,
                                    const std::function<void(double)>& progress = {}) const;

  /// Whether pull_back() has the gradient: not with a loss between clouds, whose nearest neighbours
  /// change, nor by a quantity that has no slope, nor where the scenes have no adjoint or contacts
  /// of several bodies follow a material that is fitted.
  [[nodiscard]] bool has_gradient() const;
  /// What pull_back() of tracks takes, in evaluations of a batch.
  [[nodiscard]] double gradient_cost() const;
  /// The derivative by each parameter (physical values) of Σ bar·x over what the captures see of a
  /// simulation: `bars` run by run and capture by capture, (T, N), none of a run that is not
  /// simulated or of which nothing is said. With images, whose Filming has a `bar`, that of these
  /// too: they are drawn and gone back through in a first simulation, since what lies between
  /// frames is known only after the next; what colliders hide is held. By the
  /// adjoint (mpm/gradient.hpp), with substeps held, and with the share of total
  /// Lagrangian velocities that is smoothed. Nothing where the simulation could not be completed,
  /// or a gigabyte does not hold its record. Equal bits for any number of threads. Throws
  /// Error(kCancelled).
  [[nodiscard]] std::optional<std::vector<double>> pull_back(
      const std::vector<double>& values, const Scope& scope,
      const std::vector<std::vector<Points>>& bars,
      const std::function<void(double)>& progress = {}) const;

  /// The same by the weights of the published law of a body, 2 · material::kNetWeights; the
  /// parameters need no derivative. Nothing also where no such body takes part.
  [[nodiscard]] std::optional<std::vector<double>> pull_back_published(
      const std::vector<double>& values, const Scope& scope,
      const std::vector<std::vector<Points>>& bars, const std::string& body,
      const std::function<void(double)>& progress = {}) const;

 private:
  struct RunModel;
  struct Trial;
  struct Listener;
  /// Hands the gradient of each run that is simulated to `use`; false where there is none.
  using UseGradient = std::function<void(std::size_t run, const mpm::Scene& scene,
                                         const mpm::Gradient& gradient, const FilmBars& drawn)>;
  [[nodiscard]] bool each_gradient(const std::vector<double>& values, const Scope& scope,
                                   const std::vector<std::vector<Points>>& bars,
                                   bool published_weights,
                                   const std::function<void(double)>& progress,
                                   const UseGradient& use) const;
  /// What the values of a run do by way of contacts that follow the material.
  void add_through_contacts(std::size_t run, std::span<const double> values,
                            const mpm::Gradient& gradient, std::span<double> sum) const;
  /// Adds the derivatives by way of the cameras of `filming`'s views to `sum`.
  void add_through_cameras(std::size_t run, std::span<const double> values, const Filming& filming,
                           const FilmBars& drawn, std::span<double> sum) const;
  [[nodiscard]] mpm::Simulation::Options simulation_options() const;
  /// Points that are given on the model, after the body was placed anew.
  [[nodiscard]] Points placed_points(std::size_t run, const Query& query, const std::string& body,
                                     Points points) const;
  /// A run as it is simulated, without its substeps.
  [[nodiscard]] Trial trial(std::size_t run, const Query& query, const Scope& scope,
                            Arena& arena) const;
  std::optional<Observation> simulate(std::size_t run, const Query& query, const Scope& scope,
                                      const std::shared_ptr<Arena>& arena, const Listener& listener,
                                      Failure& failure) const;
  /// What is seen of one attempt.
  [[nodiscard]] Observation observe(const Trial& trial, const Scope& scope,
                                    const std::shared_ptr<Arena>& arena,
                                    const Listener& listener) const;
  /// What is drawn of it.
  [[nodiscard]] Filmer::Given filmed(const Trial& trial, const Scope& scope,
                                     std::size_t query) const;
  /// Binds the splats of bodies that are placed anew.
  void carry_splats(std::size_t run, const Query& query, Trial& trial, Arena& arena) const;
  /// The cotangents of what is recorded for images of a trial, whose substeps are settled.
  [[nodiscard]] FilmBars film_bars(const Trial& trial, const Scope& scope,
                                   const std::shared_ptr<Arena>& arena) const;

  const std::vector<Run>& runs_;
  const Parameters& parameters_;
  Options options_;
  const Interrupter& interrupter_;
  std::vector<std::unique_ptr<RunModel>> models_;
  std::size_t bytes_ = 0;  ///< that one simulation takes, of the largest run
};

}  // namespace matterfit::fit
