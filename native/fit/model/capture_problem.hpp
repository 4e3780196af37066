// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fit/data/cloud_residuals.hpp"
#include "fit/model/model.hpp"
#include "fit/model/window.hpp"
#include "fit/numerics/least_squares.hpp"

namespace matterfit::fit {

/// Which samples count, run by run and capture by capture: (T, N) each, borrowed; null: none.
using Mask = std::vector<std::vector<const std::vector<std::uint8_t>*>>;
/// Capture::used of all; the runs are borrowed.
[[nodiscard]] Mask used_samples(const std::vector<Run>& runs);

/// Residuals of simulations against the samples of a mask over one window. Those of clouds are
/// cloud_residuals(), 6 a captured point; the squares of a perfect fit sum up to half their
/// number.
class CaptureProblem final : public Problem {
 public:
  CaptureProblem(const Model& model, const std::vector<Run>& runs,
                 std::vector<Parameter> parameters, Loss loss, Window window, Mask mask);

  std::vector<std::optional<Eigen::VectorXd>> evaluate(
      const std::vector<Eigen::VectorXd>& points) override;
  Problem* stand_in() override { return stand_in_; }
  /// Computed by the model's adjoint.
  std::optional<Eigen::VectorXd> transposed(const Eigen::VectorXd& point,
                                            const Eigen::VectorXd& weights) override;
  [[nodiscard]] double transposed_cost() const override;
  /// The same by the weights of a body's published law (Model::pull_back_published()).
  [[nodiscard]] std::optional<std::vector<double>> transposed_published(
      const Eigen::VectorXd& point, const Eigen::VectorXd& weights, const std::string& body) const;
  /// Cotangents of what is seen, from those of the residuals of tracks.
  [[nodiscard]] std::vector<std::vector<Points>> seen_bars(const Eigen::VectorXd& weights) const;
  /// Borrowed: the same captures against a coarser model.
  void set_stand_in(CaptureProblem* problem) { stand_in_ = problem; }

  /// How every evaluation is stepped; an empty one: as the solver chooses.
  [[nodiscard]] const StepPlan& plan() const { return plan_; }
  void set_plan(StepPlan plan) { plan_ = std::move(plan); }

  /// Told the fraction of a batch that is done.
  std::function<void(double)> progress;

  [[nodiscard]] std::vector<double> physical(const Eigen::VectorXd& point) const;
  [[nodiscard]] Eigen::VectorXd residuals(const Outcome& outcome) const;
  /// Distance of every sample of the mask [m], run by run, capture by capture, frame by frame. Of
  /// clouds what the means around each captured point are apart.
  [[nodiscard]] std::vector<double> distances(const Eigen::VectorXd& residual) const;
  /// Root mean square of distances() [m].
  [[nodiscard]] double rms(const Eigen::VectorXd& residual) const;
  /// The same of a point that was evaluated since forget(); NaN if it was not.
  [[nodiscard]] double rms_seen(const Eigen::VectorXd& point) const;
  void forget() { seen_.clear(); }
  /// How many of the residuals count as independent: fewer where they hang together from frame to
  /// frame and from point to point, as those of a wrong law do.
  [[nodiscard]] double effective(const Eigen::VectorXd& residual) const override;
  /// Eight stretches of time by, for tracks, eight parts of the body.
  [[nodiscard]] std::vector<std::uint32_t> blocks() const override;

 private:
  /// Captured points of one frame, and what cloud_means() makes of them.
  struct Cloud {
    Points points;
    Points means;
  };
  /// The frames of one capture that lie in the window and have a used sample.
  struct Part {
    std::size_t run = 0;
    std::size_t capture = 0;
    const std::vector<std::uint8_t>* mask = nullptr;
    std::vector<std::size_t> frames;
    std::vector<double> deviations;  ///< Capture::deviation() of its points
    CloudScale scale;                ///< of clouds
    std::vector<Cloud> clouds;       ///< one a frame
  };
  [[nodiscard]] const Capture& capture_of(const Part& part) const {
    return runs_[part.run].captures[part.capture];
  }

  [[nodiscard]] Scope scope() const;

  const Model& model_;
  const std::vector<Run>& runs_;
  std::vector<Parameter> parameters_;
  Loss loss_;
  Window window_;
  StepPlan plan_;
  CaptureProblem* stand_in_ = nullptr;
  std::vector<Part> parts_;
  std::vector<std::pair<Eigen::VectorXd, double>> seen_;
};

}  // namespace matterfit::fit
