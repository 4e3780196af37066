// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "fit/model/image_problem.hpp"
#include "fit/model/model.hpp"
#include "fit/model/particle_colours.hpp"
#include "job/documents/document.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_experiment.hpp"
#include "job/run/image_sightings.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// How well a simulation agrees with images and tracks.
struct ImageStanding {
  Json silhouettes = {{"fitted", nullptr}, {"held_out", nullptr}};
  Json cameras = Json::array();
  Json tracks = {{"fitted", nullptr}, {"held_out", nullptr}};
};

/// A job's images and, where it has any, tracks, with the scenes that are to explain them. Values
/// are physical, one a parameter. Throws as a fit does.
class ImageExperiment {
 public:
  /// Reads everything and fills the bodies. What is odd goes into `statements`. All else is
  /// borrowed.
  ImageExperiment(const Job& job, const FitDoc& fit, const RunOptions& options,
                  const Interrupter& interrupter, std::vector<std::string>& statements);
  ImageExperiment(const ImageExperiment&) = delete;
  ImageExperiment& operator=(const ImageExperiment&) = delete;

  /// Makes the model anew: its scenes by what `with` makes of the builders (empty: the builders
  /// themselves), with `more` parameters after the document's. Problems of before are no longer to
  /// be used; sizes and colours stay.
  void extend(const std::function<fit::SceneBuilder(fit::SceneBuilder)>& with,
              std::vector<fit::ParameterSpec> more);

  [[nodiscard]] const LoadedExperiment& loaded() const { return loaded_; }
  [[nodiscard]] const LoadedFilms& films() const { return films_; }
  [[nodiscard]] bool has_tracks() const { return has_tracks_; }  ///< that are fitted
  [[nodiscard]] const fit::Parameters& parameters() const { return *parameters_; }
  [[nodiscard]] fit::Model& model() { return *at_->model; }
  /// Whether the pose of a camera is among the parameters.
  [[nodiscard]] bool moves_cameras() const;

  /// From here on every run takes the substeps that the solver chooses at these values.
  void settle_steps(const std::vector<double>& values);
  /// Chooses how large particles are drawn, as they stand at these values.
  void settle_sizes(const std::vector<double>& values);
  /// Takes the particles' colours from the images at the scene's first frame, with these values.
  /// False: no image shows any.
  bool learn_colours(const std::vector<double>& values);

  /// Values in the natural coordinates of the parameters.
  [[nodiscard]] Eigen::VectorXd natural(const std::vector<double>& values) const;
  /// The parameters with these values as their starts.
  [[nodiscard]] std::vector<fit::Parameter> parameters_from(
      const std::vector<double>& values) const;
  /// The same, all but velocities, spins and poses held near these values.
  [[nodiscard]] std::vector<fit::Parameter> motion_from(const std::vector<double>& values) const;
  /// The problem of all that is fitted, from these values on, images blurred [reduced pixels].
  [[nodiscard]] fit::ImageProblem problem(const std::vector<double>& values, double blur);
  /// The same of images at the scene's first frame alone, which cost no simulation.
  [[nodiscard]] fit::ImageProblem first_frame(const std::vector<double>& values, double blur);
  /// Whether a velocity or a spin is among the parameters.
  [[nodiscard]] bool finds_throw() const;
  /// The problem of the images up to a time [s] alone, without tracks.
  [[nodiscard]] fit::ImageProblem beginning(const std::vector<double>& values, double blur,
                                            double until);
  /// Times of the fitted images after the scene's first frame, ascending, each once [s].
  [[nodiscard]] std::vector<double> later_times() const;
  /// Whether an image of that frame is fitted.
  [[nodiscard]] bool sees_first_frame() const;

  /// The errors of all images, in their own pixels, and of all tracks, held-out ones too.
  [[nodiscard]] ImageStanding standing(const std::vector<double>& values);

  /// The residuals of problem() with `level` times the particle separation; `settle` settles its
  /// substeps, sizes and colours. Throws Error(kInput) or Error(kCompute) where there are none.
  [[nodiscard]] Eigen::VectorXd residuals_at(double level, const std::vector<double>& values,
                                             double blur, const std::function<void()>& settle);

 private:
  /// The model at one particle separation, with its tracks and what was settled for it.
  struct Resolution {
    std::unique_ptr<fit::Model> model;
    std::optional<fit::CaptureProblem> tracks;
    std::optional<fit::ParticleColours> colours;
    fit::StepPlan plan;
  };

  [[nodiscard]] std::vector<fit::Run>& runs() { return loaded_.experiment.runs; }
  [[nodiscard]] std::vector<mpm::Scene> build_scenes(double level) const;
  void make_parameters(const std::vector<mpm::Scene>& scenes, std::vector<fit::ParameterSpec> more);
  /// The model of these scenes, with nothing settled; the parameters must be there.
  [[nodiscard]] std::unique_ptr<Resolution> resolution(std::vector<mpm::Scene> scenes);
  [[nodiscard]] std::vector<std::vector<std::uint8_t>> moved_cameras() const;
  /// What of the memory limit is left for simulations [GB]. Throws Error(kInput) where the fit does
  /// not go into it.
  [[nodiscard]] double memory_left(const std::vector<mpm::Scene>& scenes) const;
  [[nodiscard]] fit::ImageProblem problem(const std::vector<double>& values, double blur,
                                          fit::ImageProblem::Parts parts, double until);

  const Job& job_;
  const FitDoc& doc_;
  const RunOptions& options_;
  const Interrupter& interrupter_;
  LoadedExperiment loaded_;
  std::vector<fit::SceneBuilder> builders_;  ///< one a run, of the document
  LoadedFilms films_;
  bool has_tracks_ = false;
  fit::Window window_;  ///< of the tracks
  std::optional<fit::Parameters> parameters_;
  std::unique_ptr<Resolution> at_;
};

}  // namespace matterfit::job
