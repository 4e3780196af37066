// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/interrupter.hpp"
#include "diagnose/model.hpp"
#include "fit/data/follow.hpp"
#include "fit/model/parameters.hpp"
#include "fit/model/step_plan.hpp"
#include "job/diagnosis/causes.hpp"
#include "job/diagnosis/contact_nuisances.hpp"
#include "job/diagnosis/motion_store.hpp"
#include "job/diagnosis/remake.hpp"
#include "job/diagnosis/shooting.hpp"
#include "job/fit_experiment.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// A fitted job as the discrepancy engine sees it (diagnose/model.hpp): its
/// scenes at any resolution, with causes put into them, seen at the captures'
/// own points and times.
///
/// At the scene's own resolution every run takes the substeps that the solver
/// chose at the fitted values, more by quarters of an octave where a point asks
/// for it, so that small differences are not drowned by another sequence of
/// substeps.
///
/// With `shooting` a run takes up the recording's rigid motion between
/// impacts (shooting.hpp).
class SceneModel final : public diagnose::Model {
 public:
  /// Which values the parameters have.
  enum class From : std::uint8_t {
    kDocument,     ///< the scene's, where a fit has ended
    kFirstFrames,  ///< those that a fit would begin with, before it has run
  };
  /// `job` has captures and a section `fit`. What is odd goes into `statements`. Throws
  /// Error(kInput) as a fit does.
  SceneModel(const Job& job, From from, const RunOptions& options, const Interrupter& interrupter,
             std::vector<std::string>& statements, bool shooting = false);
  ~SceneModel() override;
  SceneModel(const SceneModel&) = delete;
  SceneModel& operator=(const SceneModel&) = delete;

  [[nodiscard]] const std::vector<diagnose::Capture>& captures() const override {
    return captures_;
  }
  [[nodiscard]] const std::vector<fit::Parameter>& parameters() const override { return listed_; }
  /// Of bodies that meet something, once begin_also_from() was called: throws as the first flights
  /// show them, with the material as it was fitted and as it was before the fit, what is in Pa of
  /// it times 1, 4 and 1/4; all else as it was fitted.
  [[nodiscard]] std::vector<Eigen::VectorXd> other_starts() const override;
  /// The fitted parameters (the first of parameters()) as they were before the fit, in SI. Throws
  /// Error(kCompute) where they are another number.
  void begin_also_from(std::vector<double> before);
  [[nodiscard]] std::vector<int> own_capture() const override;
  [[nodiscard]] std::vector<Eigen::Index> corrections() const override;
  [[nodiscard]] std::vector<Eigen::Index> state_errors() const override;
  [[nodiscard]] bool follows_recordings() const override { return !nodes_.empty(); }
  [[nodiscard]] std::vector<diagnose::ContactFrame> contact_frames() const override;
  [[nodiscard]] const std::vector<diagnose::Effect>& effects() const override { return rows_; }
  [[nodiscard]] std::vector<std::optional<diagnose::Motion>> simulate(
      const std::vector<diagnose::Point>& points) const override;
  [[nodiscard]] bool has_numerics() const override { return true; }
  /// The first run made otherwise (remake.hpp).
  [[nodiscard]] std::vector<diagnose::Experiment> experiments() const override {
    return experiments_;
  }
  [[nodiscard]] std::vector<std::optional<diagnose::Motion>> simulate_experiment(
      int experiment, const std::vector<diagnose::Point>& points) const override;

  /// work_of() all runs at the fitted values.
  [[nodiscard]] double work() const { return work_; }

  /// Keeps what is simulated from now on, and takes what was kept (for parameters that were fitted
  /// alike, of the same inputs). It outlives the model.
  void keep_in(const MotionStore* store) { store_ = store; }

  /// Puts a point's parameters and causes into the job's document, what a camera did into its
  /// captures. What no key of a document says goes into `statements`.
  void write(const diagnose::Point& point, Json& document,
             std::vector<std::string>& statements) const;

 private:
  /// A run's scene at some numerics, with what looks at its captures.
  struct Built {
    mpm::Scene scene;
    std::vector<std::size_t> bodies;  ///< of each capture
    std::vector<fit::PointFollower> followers;
  };
  /// The points of each capture of a run, frame by frame.
  using Seen = std::vector<std::vector<Points>>;
  /// A node and the state that it takes, by what cameras are thought to have done.
  struct Target {
    ShootingNode node;
    RigidState state;
  };
  /// Who looks at a run, at which values of the fitted parameters.
  struct Watch {
    const Built& base;
    const std::vector<double>& values;
    std::size_t run;
    const std::shared_ptr<Arena>& arena;
    std::vector<Target> targets;
    Vec3d shift = Vec3d::Zero();  ///< by which the scene was moved (fit::world_shift())
  };
  [[nodiscard]] const std::vector<fit::Run>& runs() const { return loaded_.experiment.runs; }
  /// The number of a run's first capture.
  [[nodiscard]] std::size_t first_capture(std::size_t run) const;
  /// An offset of the grid without the axes along which a body's grid fits its shape: there the
  /// scene's own solver has none.
  [[nodiscard]] Vec3d free_offset(const Vec3d& offset, std::size_t run) const;
  [[nodiscard]] std::shared_ptr<const Built> built(const diagnose::Numerics& numerics,
                                                   std::size_t run) const;
  struct SimulatedRun {
    std::vector<fit::SimulatedCapture> captures;
    double work = 0.0;  ///< work_of()
  };
  [[nodiscard]] std::optional<SimulatedRun> simulate_run(const diagnose::Point& point,
                                                         std::size_t run,
                                                         const std::shared_ptr<Arena>& arena) const;
  /// Particles times substeps, several times that of bodies whose substep is dearer.
  [[nodiscard]] static double work_of(const mpm::Scene& scene, const std::vector<int>& substeps);
  /// A point without what sets in only after all that is looked at, so that it is simulated once.
  [[nodiscard]] diagnose::Point as_looked_at(diagnose::Point point) const;
  /// scene.end_frame of a run that shows what is looked at of a point.
  [[nodiscard]] int end_frame(const diagnose::Point& point, const std::vector<double>& values,
                              std::size_t run) const;
  /// What all runs' captures see, as one motion; nothing where one could not be simulated.
  [[nodiscard]] std::optional<diagnose::Motion> motion_of(
      const std::vector<std::optional<SimulatedRun>>& seen) const;
  /// A run's scene at a point, without what was set right after impacts.
  [[nodiscard]] mpm::Scene scene_at(const diagnose::Point& point, const Built& base,
                                    const std::vector<double>& values, std::size_t run) const;
  /// What is seen of a scene. `substeps`: takes those of each frame; null: nobody asks. Throws
  /// Error(kCompute) where it cannot be simulated to its end.
  [[nodiscard]] Seen watched(const mpm::Scene& scene, const Watch& watch,
                             std::vector<int>* substeps = nullptr) const;
  /// The same, or nothing. Appends to `substeps`, also those of a run that failed.
  [[nodiscard]] std::optional<Seen> watched_if_possible(const mpm::Scene& scene, const Watch& watch,
                                                        std::vector<int>& substeps) const;
  [[nodiscard]] std::vector<Target> targets_of(const diagnose::Point& point, std::size_t run) const;
  /// Takes the simulation to the states of this frame, the last that was `seen`.
  void take_up(const Watch& watch, const mpm::Scene& scene, const Seen& seen,
               const mpm::ObservedFrame& frame, mpm::Simulation& simulation) const;
  /// The same with substeps that were settled, more of them where the scene asks for it.
  [[nodiscard]] std::optional<Seen> watch_in_steps(mpm::Scene scene, const fit::RunSteps& steps,
                                                   const Watch& watch,
                                                   std::vector<int>& substeps) const;
  /// The substeps that the solver chooses for a scene. Throws Error(kCompute) where it cannot be
  /// simulated to its end.
  [[nodiscard]] fit::RunSteps solvers_steps(const mpm::Scene& scene, const Watch& watch) const;
  void write_nuisances(const diagnose::Point& point, Json& document,
                       std::vector<std::string>& statements) const;
  void write_observed(const diagnose::Point::Cause& cause, Json& document,
                      std::vector<std::string>& statements) const;
  [[nodiscard]] std::vector<Encounter> encounters_with(const shape::Keyed<Vec3d>& gravity) const;
  [[nodiscard]] std::vector<fit::Address> fitted_numbers() const;
  void list_captures();
  /// ContactNuisances, as parameters after the fitted ones.
  void add_nuisances();
  void add_shooting_nodes();
  void add_state_errors();
  /// Number of the parameter that is the first node's first error.
  [[nodiscard]] std::size_t first_of_states() const {
    return fitted_count_ + nuisances_.parameters().size();
  }
  /// Sets throws among values of the fitted parameters to what the first flights show.
  void set_throws(std::vector<double>& values) const;
  [[nodiscard]] std::vector<double> fitted_values(const diagnose::Point& point) const;
  [[nodiscard]] std::vector<double> nuisance_values(const diagnose::Point& point) const;
  void settle_steps();
  void list_experiments();
  [[nodiscard]] diagnose::Point start_point() const;  ///< all parameters at their starts

  const Job& job_;
  bool shooting_;
  RunOptions options_;
  const Interrupter& interrupter_;
  LoadedExperiment loaded_;
  std::unique_ptr<fit::Parameters> parameters_;
  /// The fitted parameters with the values of From, then the nuisances', then errors of the nodes'
  /// states.
  std::vector<fit::Parameter> listed_;
  std::size_t fitted_count_ = 0;
  std::vector<double> before_;  ///< begin_also_from()
  ContactNuisances nuisances_;
  std::vector<Target> nodes_;      ///< with the states of a camera that did nothing
  std::vector<Inertia> inertias_;  ///< of each run's only body, where it has nodes
  std::vector<Cause> causes_;
  std::vector<diagnose::Effect> rows_;
  std::vector<diagnose::Capture> captures_;
  std::vector<const fit::CaptureInput*> inputs_;   ///< of each of them
  std::vector<fit::RunSteps> steps_;               ///< of each run, at the fitted values
  double work_ = 1.0;                              ///< work_of() them
  std::vector<Remake> remakes_;                    ///< of the first run
  std::vector<diagnose::Experiment> experiments_;  ///< of each of them
  const MotionStore* store_ = nullptr;
  mutable std::mutex mutex_;
  mutable std::map<std::string, std::shared_ptr<const Built>> built_;
};

}  // namespace matterfit::job
