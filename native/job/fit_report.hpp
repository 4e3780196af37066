// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fit/model/model.hpp"
#include "fit/numerics/uncertainty.hpp"
#include "fit/search/law_fit.hpp"
#include "job/documents/fit_document.hpp"
#include "job/run/capture_input.hpp"

/// What a fit says when it is done (docs/formats.md, "fit").
namespace matterfit::job {

/// Errors of several captures together, what is held out apart.
class ErrorPool {
 public:
  /// Adds the samples that a fit uses or predicts. `error_mm` (T, N); not finite: left out.
  void add(const fit::Capture& capture, const std::vector<double>& error_mm, double body_size);
  /// Adds samples of so many frames whose error is known without their place [m].
  void add(const std::vector<double>& distances, double body_size, std::size_t frames,
           bool held_out);

  /// {"fitted": {…}, "held_out": {…} or null}.
  [[nodiscard]] Json json() const;
  /// Mean error [mm]; nothing without samples.
  [[nodiscard]] std::optional<double> mean(bool held_out) const;
  /// Frames with at least one sample, over all captures.
  [[nodiscard]] std::size_t frames(bool held_out) const { return frames_[held_out ? 1 : 0]; }

 private:
  std::vector<double> errors_[2];    ///< fitted, held out [mm]
  std::vector<double> percents_[2];  ///< of the body's size
  std::size_t frames_[2] = {0, 0};
};

/// The errors of an outcome of the whole clip, point by point; for clouds, how far apart the means
/// around each captured point are.
[[nodiscard]] ErrorPool errors_of(const std::vector<fit::Run>& runs, const fit::Model& model,
                                  FitDoc::Loss loss, const fit::Outcome& outcome);
/// The errors of the simulation at a law's values, which is fit::LawFit::predict().
[[nodiscard]] std::optional<ErrorPool> errors_of(fit::LawFit& fit, const fit::LawState& state,
                                                 bool fitted, std::string& failure);

/// fit::LawFit::advance(), its steps as entries of `fit.history` and fit/history.jsonl.
void advance(fit::LawFit& fit, fit::LawState& state, std::vector<Json>& history);

/// One entry a number of `fit.parameters`. Without an uncertainty (a fit that was cancelled) errors
/// and intervals are null.
[[nodiscard]] Json parameters_json(const std::vector<fit::Parameter>& parameters,
                                   const std::vector<double>& values,
                                   const std::optional<fit::Uncertainty>& uncertainty);

[[nodiscard]] Json correlation_json(const fit::Uncertainty& uncertainty);

/// The models of a search for the law, the best first, with how sure that is: weights ∝ mean
/// error^(−n) on what is held out, n its frames, where each of k parameters has to take off 2 % of
/// it; without a hold-out on what was fitted, times n^(−k/2). Failed ones at the end. `models`:
/// FitState::models.
[[nodiscard]] Json ranked_models(const std::vector<fit::LawState>& laws,
                                 const std::vector<Json>& models);

/// Why a result is not to be used as it stands: its search did not end at a minimum, or `far` from
/// the capture (fit::LawFit::is_far()); else empty. `fit` is the result's object `fit`.
[[nodiscard]] std::string fit_warning(const Json& fit, bool far);
/// The same of a fit that does not predict what it was not shown; else empty. `after` is the
/// result's object of that name.
[[nodiscard]] std::string held_out_warning(const Json& after);

/// `material.json`: a preset with its provenance. `fit` is the result's object `fit`.
[[nodiscard]] Json material_preset(const Job& fitted, const std::string& body, const Json& fit);

}  // namespace matterfit::job
