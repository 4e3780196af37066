// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fit/numerics/least_squares.hpp"
#include "job/documents/json_reader.hpp"
#include "job/image_experiment.hpp"
#include "material/neural/published_weights.hpp"

namespace matterfit::job {

/// Where a fit to images goes on that has ended.
struct ImageWeightsStart {
  std::vector<double> values;  ///< physical, of its parameters
  std::string body;            ///< of the law neural_isotropic or neural
  int iterations = 0;          ///< accepted steps at most
  double blur = 1.0;           ///< of the images that are compared [reduced pixels]
  fit::LeastSquaresOptions options;
  std::function<void(int evaluations)> tell;
};

/// A fit to images that went on with all weights of a body's neural law.
// NOLINTNEXTLINE(bugprone-exception-escape): of the JSON library's moves it cannot tell
struct ImageWeights {
  bool taken = false;
  std::vector<double> values;  ///< where taken: of the experiment's parameters as it is left
  /// Of the published law, where taken; null: the moves are among the values.
  std::shared_ptr<const material::PublishedWeights> published;
  int evaluations = 0;
  /// `body`, `taken`, `iterations`, `evaluations`, `held_out_iou` and `fitted_iou` with `without`
  /// and `with` each, null where not known.
  Json report;
  std::string statement;
};

/// As fit_weights() and fit_published_weights() do for tracks, with images that are drawn of every
/// simulation and the slope by the adjoint of both: what predicts the held-out outlines best (their
/// mean IoU; without a hold-out that of the fitted ones) is taken, and nothing that is no better
/// than without. The experiment is left with the weights taken, or as it was. Throws as a fit does.
[[nodiscard]] ImageWeights fit_image_weights(ImageExperiment& experiment,
                                             const ImageWeightsStart& from,
                                             std::vector<Json>& history);

/// The first of these bodies whose law has weights that can be moved; empty: none has.
[[nodiscard]] std::string body_with_weights(const Job& job, const std::vector<std::string>& bodies);

/// Writes weights that were taken into the job's folder, and the file into `document`, which holds
/// the fitted values.
void write_image_weights(const ImageWeights& weights, const Job& job, Json& document);

}  // namespace matterfit::job
