// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "fit/data/cloud_residuals.hpp"
#include "fit/numerics/least_squares.hpp"
#include "job/fit_model.hpp"

namespace matterfit::job {

/// The first part of all captures: how long each run is simulated and compared.
struct FitWindow {
  std::vector<double> until;  ///< [s] of each run; negative: not simulated
  int first_frame = 0;        ///< of the first fitted run, for names
  int last_frame = 0;
};

/// Windows that double, from a few samples after the motion begins to all that are used; only the
/// last where `grow` is off.
[[nodiscard]] std::vector<FitWindow> fit_windows(const std::vector<FitRun>& runs, bool grow);
/// At most `samples` used times of each run.
[[nodiscard]] FitWindow fit_window(const std::vector<FitRun>& runs, std::size_t samples);

/// Residuals of simulations against the captures over one window. Those of clouds are
/// fit::cloud_residuals(), 6 a captured point; the squares of a perfect fit sum up to half their
/// number.
class FitProblem final : public fit::Problem {
 public:
  FitProblem(const FitModel& model, const std::vector<FitRun>& runs,
             std::vector<fit::Parameter> parameters, FitDoc::Loss loss, FitWindow window);

  std::vector<std::optional<Eigen::VectorXd>> evaluate(
      const std::vector<Eigen::VectorXd>& points) override;
  fit::Problem* stand_in() override { return stand_in_; }
  /// By the model's adjoint.
  std::optional<Eigen::VectorXd> transposed(const Eigen::VectorXd& point,
                                            const Eigen::VectorXd& weights) override;
  [[nodiscard]] double transposed_cost() const override;
  /// Borrowed: the same captures against a coarser model.
  void set_stand_in(FitProblem* problem) { stand_in_ = problem; }

  /// Told the fraction of a batch that is done.
  std::function<void(double)> progress;

  [[nodiscard]] std::vector<double> physical(const Eigen::VectorXd& point) const;
  [[nodiscard]] Eigen::VectorXd residuals(const FitOutcome& outcome) const;
  /// Distance of every used sample [m], run by run, capture by capture, frame by frame. Of
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
    std::vector<std::size_t> frames;
    std::vector<double> deviations;  ///< FitCapture::deviation() of its points
    fit::CloudScale scale;           ///< of clouds
    std::vector<Cloud> clouds;       ///< one a frame
  };
  [[nodiscard]] const FitCapture& capture_of(const Part& part) const {
    return runs_[part.run].captures[part.capture];
  }

  const FitModel& model_;
  const std::vector<FitRun>& runs_;
  std::vector<fit::Parameter> parameters_;
  FitDoc::Loss loss_;
  FitWindow window_;
  FitProblem* stand_in_ = nullptr;
  std::vector<Part> parts_;
  std::vector<std::pair<Eigen::VectorXd, double>> seen_;
};

}  // namespace matterfit::job
