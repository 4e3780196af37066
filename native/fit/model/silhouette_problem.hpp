// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fit/data/silhouette.hpp"
#include "fit/model/silhouette_model.hpp"
#include "fit/numerics/least_squares.hpp"

namespace matterfit::fit {

/// A matte that simulations are compared with, reduced, and how it is drawn.
struct Sighting {
  SilhouetteView view;  ///< its camera takes images of the matte's size
  Coverage matte;
  /// How much of each pixel the recording's lens saw: of what is drawn only that is compared. The
  /// matte is 0 elsewhere. Empty: all.
  std::vector<float> seen;
  double noise = 1.0;      ///< of an outline's place [pixels of the matte]
  std::size_t camera = 0;  ///< those of one number share a size of the particles
  bool held_out = false;   ///< nothing is taken from it
};

/// Residuals (simulated − captured coverage) / σ of all sightings, pixel by pixel, both blurred by
/// `blur` pixels; σ is coverage_deviation(), so that half the sum of squares is that of outlines
/// displaced by independent errors of the stated noise. A wide blur leads from farther away.
class SilhouetteProblem final : public Problem {
 public:
  /// The model is borrowed. Sightings are in order of time.
  SilhouetteProblem(const SilhouetteModel& model, std::vector<Parameter> parameters,
                    std::vector<Sighting> sightings, double blur);

  std::vector<std::optional<Eigen::VectorXd>> evaluate(
      const std::vector<Eigen::VectorXd>& points) override;
  /// Lengths of the outlines [pixels]: where nothing moves nothing is known.
  [[nodiscard]] double effective(const Eigen::VectorXd& residual) const override;
  /// Eight stretches of the sightings.
  [[nodiscard]] std::vector<std::uint32_t> blocks() const override;

  [[nodiscard]] std::vector<double> physical(const Eigen::VectorXd& point) const;
  /// Why the last point could not be simulated.
  [[nodiscard]] const std::string& failure() const { return failure_; }
  /// Told after each batch how many points were simulated since the beginning.
  std::function<void(int)> simulated;

 private:
  const SilhouetteModel& model_;
  std::vector<Parameter> parameters_;
  std::vector<Sighting> sightings_;
  double blur_;
  std::vector<SilhouetteView> views_;
  std::vector<std::size_t> first_;  ///< residual of each sighting; the number of all at the end
  double outlines_ = 0.0;
  std::string failure_;
  int count_ = 0;
};

/// The size of the particles with which each camera's first sighting that is not held out, at these
/// values, covers as much of its image as the matte does: what a Gaussian's soft edge adds to a
/// body, and what matting takes from it, is then in no residual but as a constant. Sets it in all
/// sightings of that camera; a camera without one takes the mean of the others. Throws
/// Error(kInput) naming the camera that sees nothing of the body where its matte does, or whose
/// matte no size explains, Error(kCompute) where the values cannot be simulated.
void settle_sizes(const SilhouetteModel& model, const std::vector<double>& values,
                  std::vector<Sighting>& sightings);

}  // namespace matterfit::fit
