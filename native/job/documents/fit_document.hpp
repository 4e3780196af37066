// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fit/data/losses.hpp"
#include "fit/model/parameters.hpp"
#include "fit/search/search_options.hpp"
#include "material/material.hpp"

namespace matterfit::job {

struct Job;  // job/documents/document.hpp

/// The section `fit` of a job (docs/formats.md).
struct FitDoc : fit::SearchOptions {
  using Loss = fit::Loss;
  std::vector<fit::ParameterSpec> parameters;
  std::vector<material::Law> laws;  ///< candidates; empty: the document's own law
  std::string body;                 ///< whose law is sought, with `laws`
  /// At the end, accepted steps with all weights of a neural law's energy at most (job/
  /// fit_weights.hpp); 0: none.
  int weights = 0;
  /// The same with a correction beside the law (job/fit_correction.hpp); 0: none.
  int correction = 0;
  /// Sets of values, drawn from their errors, that what is held out is predicted with (job/
  /// fit_predicted.hpp); 0: none.
  int draws = 0;
};

/// The word for it in a document.
[[nodiscard]] std::string_view loss_name(FitDoc::Loss loss);

/// The job's section 'fit'. Throws Error(kInput) where it has none.
[[nodiscard]] const FitDoc& fit_of(const Job& job);

}  // namespace matterfit::job
