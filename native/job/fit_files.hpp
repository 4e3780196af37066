// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "job/documents/document.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/inputs.hpp"
#include "math/simd_target.hpp"

/// The files that a fit leaves in its output folder (docs/formats.md).
namespace matterfit::job {

inline constexpr const char* kFitHistoryPath = "fit/history.jsonl";
inline constexpr const char* kFittedPath = "fit/fitted.json";

/// A fit whose search is done: what remains is the simulation of the fitted scene.
struct Fitted {
  std::string input_hash;
  Inputs inputs;
  Json document;  ///< the fitted scene as a job
  Json fit;       ///< the result's object `fit`, but for the errors after it
};

/// The job's document without its fit, as one that `simulate` takes, with results in `folder`.
[[nodiscard]] Json document_to_simulate(const Job& job, const std::filesystem::path& folder);

/// Whose material a fit writes: those that it moves, `otherwise` where there is none.
[[nodiscard]] std::vector<std::string> fitted_bodies(const FitDoc& fit,
                                                     const std::string& otherwise);

void write_fitted(const std::filesystem::path& folder, const Fitted& fitted);
/// Nothing if it is missing or damaged.
[[nodiscard]] std::optional<Fitted> read_fitted(const std::filesystem::path& folder);

/// For a fit that may not replace anything. Throws Error(kInput) where the folder holds a fit of
/// other inputs than `now`, finished or not, or the results of another task: what it holds, what
/// changed, and what to do.
void refuse_what_is_there(const std::filesystem::path& folder, const Inputs& now);

/// `history.jsonl`, one object a line.
void write_history(const std::filesystem::path& folder, const std::vector<Json>& history);

/// `scene.json` and, for each body, `material.json` (from the second on `material_NAME.json`);
/// returns their names. Removes materials that an earlier fit wrote and this one does not.
[[nodiscard]] std::vector<std::string> write_materials(const std::filesystem::path& folder,
                                                       const Job& fitted,
                                                       const std::vector<std::string>& bodies,
                                                       const Json& fit);

/// Words of a fit that was cancelled and handed out its best values.
inline constexpr const char* kCancelledWarning =
    "The fit was cancelled: these are the best values so far. Resume goes on.";

/// A fit whose fitted scene has not been run.
struct Unfinished {
  const std::filesystem::path& folder;
  const Job& fitted;
  std::vector<std::string> bodies;
  SimdTarget target;
};

/// Writes `result.json` and the materials without the fitted scene's run and returns the result,
/// its `status` "cancelled" or "failed" as `why` is.
Json write_unfinished(const Unfinished& of, Json fit, const Error& why);

/// Runs the fitted scene by `run` and returns its result. A run that is cancelled ends as
/// write_unfinished(); one that cannot be simulated too, and throws Error(kCompute), which says
/// where the values are.
Json run_or_unfinished(const Unfinished& of, const Json& fit, const std::function<Json()>& run);

}  // namespace matterfit::job
