// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/interrupter.hpp"
#include "job/documents/document.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_files.hpp"
#include "job/image_experiment.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// The share of a fit's progress that its search is.
inline constexpr double kImageFitShare = 0.9;

/// The end of a fit to images whose search is done or was broken off. All is borrowed.
class FittedImages {
 public:
  FittedImages(const Job& job, const FitDoc& fit, const RunOptions& options)
      : job_(job), doc_(fit), options_(options) {}

  /// The fitted scene as a job that `simulate` takes; `values` are physical, one of `parameters`
  /// each.
  [[nodiscard]] Json document(const ImageExperiment& scene, const fit::Parameters& parameters,
                              const std::vector<double>& values) const;

  /// Runs the fitted scene and writes the result with its `fit`. Cancelled, or where the scene does
  /// not run, the result has the values alone. Throws as a run does, but not Error(kCancelled).
  Json simulate(const Json& document, const Json& fit, Interrupter& interrupter) const;

  /// Writes and returns the result of a fit whose scene was not run, because of `why`.
  Json unfinished(const Json& document, Json fit, const Error& why) const;

 private:
  [[nodiscard]] Job job_of(const Json& document) const;
  [[nodiscard]] Unfinished unrun(const Job& scene) const;
  [[nodiscard]] std::vector<std::string> bodies_of(const Job& scene) const;

  const Job& job_;
  const FitDoc& doc_;
  const RunOptions& options_;
};

}  // namespace matterfit::job
