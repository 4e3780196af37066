// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fit/model/image_problem.hpp"
#include "fit/numerics/uncertainty.hpp"
#include "job/documents/document.hpp"
#include "job/documents/fit_document.hpp"
#include "job/image_experiment.hpp"
#include "job/image_fit_state.hpp"

namespace matterfit::job {

/// A fit to images at its end; borrowed.
struct ImageFitEnd {
  const Job& job;
  const FitDoc& doc;
  const ImageExperiment& scene;
  const fit::Parameters& parameters;  ///< whose values those of `state` are
  const ImageFitState& state;
  const fit::ImageProblem::Misfit& misfit;       ///< NaN where nothing was compared
  const std::optional<fit::Uncertainty>& known;  ///< none where weights alone are fitted
  const ImageStanding& after;
};

/// The `fit` of its result (docs/formats.md); `statements` come before the report's own.
[[nodiscard]] Json image_fit_json(const ImageFitEnd& end, std::vector<std::string> statements);

}  // namespace matterfit::job
