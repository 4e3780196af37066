// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "job/fit_search.hpp"

namespace matterfit::job {

/// A fit that goes on with all weights of a neural law's energy.
struct WeightsFit {
  std::unique_ptr<LawFit> fit;  ///< of the parameters before and of `material.weight_moves[#]`
  LawState state;               ///< the best of its iterations
  bool taken = false;           ///< it is nearer than the fit before
  Json report;                  ///< `fit.weights` of the result (docs/formats.md)
};

/// From where a fit of `before` ended, with a body's 29 weights (all but the scale, which E is)
/// among the parameters, each with a prior of its row about the start law: Levenberg–Marquardt as
/// in the last stage of any fit, at most `iterations` accepted steps. The best iterate is the one
/// with the least mean error on what is held out; without a hold-out the last. `taken` only where
/// that is less than the fit before has: what is held out then chooses, and its error is no longer
/// that of something unseen. `setup` is that of the fit before. Throws as LawFit does.
[[nodiscard]] WeightsFit fit_weights(FitSetup setup, const LawState& before,
                                     const std::string& body, int iterations,
                                     const Interrupter& interrupter,
                                     std::vector<std::string>& statements,
                                     std::vector<Json>& history,
                                     const std::function<void(const FitReport&)>& tell);

/// Gives the bodies of `document` whose weights or code are among the parameters a list of zeros
/// for them, where they have none.
void add_weight_lists(const fit::Parameters& parameters, Json& document);

/// The name of the file in a fit's folder that holds a body's weights.
[[nodiscard]] std::string weights_file_name(const std::string& body);

/// Writes a fitted material's weights, its weight_moves in them, to that file of the folder, and
/// has the body of `document` name it in place of the moves.
void write_weights(const material::Material& fitted, const std::string& body,
                   const std::filesystem::path& folder, Json& document);

}  // namespace matterfit::job
