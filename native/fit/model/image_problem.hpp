// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fit/data/silhouette.hpp"
#include "fit/model/capture_problem.hpp"
#include "fit/model/filming.hpp"
#include "fit/model/model.hpp"
#include "fit/numerics/least_squares.hpp"

namespace matterfit::fit {

/// An image that simulations are compared with, reduced, and how it is drawn.
struct Sighting {
  View view;  ///< its camera takes images of the matte's size
  Coverage matte;
  /// How much of each pixel the recording's lens saw: of what is drawn only that is compared. The
  /// matte is 0 elsewhere. Empty: all.
  std::vector<float> seen;
  double noise = 1.0;               ///< of an outline's place [pixels of the matte]
  bool held_out = false;            ///< nothing is taken from it
  std::array<Coverage, 3> colours;  ///< sRGB, 0 to 1, of the matte's size; empty: not compared
  double colour_noise = 0.1;        ///< of a colour

  [[nodiscard]] bool has_colours() const { return !colours[0].values.empty(); }
};

/// Residuals of images and, after them, of tracks, each divided by its own standard deviation, so
/// that half the sum of all squares is minus the logarithm of the likelihood of both together.
/// Those of images are (simulated − captured coverage) / σ, pixel by pixel, both blurred by `blur`
/// pixels; σ is coverage_deviation(), so that half the sum of squares is that of outlines displaced
/// by independent errors of the stated noise. A wide blur leads from farther away.
///
/// With colours, of those sightings that have some, behind the coverage and channel by channel
///   m (Σ T α k c − (Σ T α k) c') / σ',
/// blurred alike: m the captured coverage, k how well a particle's colour c is known, c' the
/// captured colour, so that only what is known and seen is compared. σ' = σ √(3 · 4π blur²) (at
/// least σ √3): errors of colours are those of light, focus and shape, and are taken to hang
/// together over the channels and over as much as the blur mixes. Images at the scene's first frame
/// are left out, for the colours are taken from them, but for those that show splats alone.
class ImageProblem final : public Problem {
 public:
  struct Parts {
    std::vector<Sighting> sightings;         ///< of run 0
    const CaptureProblem* tracks = nullptr;  ///< borrowed; null: images alone
    Window window;  ///< of the tracks' runs; those of −1 are not simulated for them
    const ParticleColours* colours = nullptr;  ///< borrowed; null: masks alone
  };
  /// The model is borrowed. `blur` [pixels].
  ImageProblem(const Model& model, std::vector<Parameter> parameters, Parts parts, double blur);

  /// What a search by all of these that are not held out takes beside its simulations, about.
  struct Memory {
    double images = 0.0;  ///< [bytes]
    double slopes = 0.0;  ///< residuals and their derivatives [bytes]
    double residuals = 0.0;
  };
  [[nodiscard]] static Memory memory(const std::vector<Sighting>& sightings,
                                     std::size_t parameters);

  std::vector<std::optional<Eigen::VectorXd>> evaluate(
      const std::vector<Eigen::VectorXd>& points) override;
  /// By the adjoint of the rasteriser, and of the model through that (Model::pull_back()).
  std::optional<Eigen::VectorXd> transposed(const Eigen::VectorXd& point,
                                            const Eigen::VectorXd& weights) override;
  [[nodiscard]] double transposed_cost() const override;
  /// The same by the weights of a body's published law (Model::pull_back_published()).
  [[nodiscard]] std::optional<std::vector<double>> transposed_published(
      const Eigen::VectorXd& point, const Eigen::VectorXd& weights, const std::string& body) const;
  /// Lengths of the outlines [pixels], for where nothing moves nothing is known; patches of colour
  /// as large as the blur; and of the tracks what CaptureProblem says.
  [[nodiscard]] double effective(const Eigen::VectorXd& residual) const override;
  /// Eight stretches of the sightings, and those of the tracks.
  [[nodiscard]] std::vector<std::uint32_t> blocks() const override;

  /// How every evaluation is stepped; an empty one: as the solver chooses.
  void set_plan(StepPlan plan) { plan_ = std::move(plan); }
  [[nodiscard]] const StepPlan& plan() const { return plan_; }
  [[nodiscard]] std::vector<double> physical(const Eigen::VectorXd& point) const;
  /// The squares of the residuals over as many as count as independent, about 1 of a perfect fit
  /// with the stated noise: of outlines, colours and tracks; NaN without any.
  struct Misfit {
    double images = 0.0;
    double colours = 0.0;
    double tracks = 0.0;
  };
  [[nodiscard]] Misfit misfit(const Eigen::VectorXd& residual) const;
  /// A state at which uncertainty() finds the information that is there: it weighs all rows by how
  /// many of them count as independent, but squares of images add up to their independent number
  /// already, and those of tracks do not.
  [[nodiscard]] LeastSquaresState as_counted(LeastSquaresState state) const;
  /// Why the last point could not be simulated.
  [[nodiscard]] const std::string& failure() const { return failure_; }
  /// Told after each batch how many points were simulated since the beginning.
  std::function<void(int)> simulated;

 private:
  [[nodiscard]] bool compares_colours(const Sighting& sighting) const {
    return parts_.colours != nullptr && sighting.has_colours() &&
           (sighting.view.time > 0.0 || sighting.view.by_splats);
  }
  /// What is drawn and stepped, for `filming`, which is borrowed.
  [[nodiscard]] Scope scope(const Filming& filming) const;
  /// The cotangents of what is drawn of a sighting, from those of all residuals.
  [[nodiscard]] Drawn drawn_bar(std::size_t sighting, const Eigen::VectorXd& weights) const;
  /// The views with these.
  [[nodiscard]] Filming filming_bar(const Eigen::VectorXd& weights) const;
  [[nodiscard]] std::vector<std::vector<Points>> track_bars(const Eigen::VectorXd& weights) const;
  /// One over the standard deviations of its residuals.
  [[nodiscard]] double coverage_weight(const Sighting& sighting) const;
  [[nodiscard]] double colour_weight(const Sighting& sighting) const;
  /// Writes the residuals of one sighting into its part of the residual.
  void compare(std::size_t sighting, const Drawn& drawn, Eigen::Ref<Eigen::VectorXd> into) const;
  /// Those of the tracks.
  [[nodiscard]] Eigen::VectorXd tail(const Eigen::VectorXd& residual) const;

  const Model& model_;
  std::vector<Parameter> parameters_;
  Parts parts_;
  double blur_;
  StepPlan plan_;
  std::vector<Coverage> mattes_;  ///< of the sightings, blurred
  std::vector<View> views_;
  std::vector<std::size_t> first_;  ///< residual of each sighting; the number of all at the end
  double outlines_ = 0.0;
  double patches_ = 0.0;  ///< of colours that count as independent
  std::string failure_;
  int count_ = 0;
};

}  // namespace matterfit::fit
