// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "fit/numerics/least_squares.hpp"
#include "fit/search/law_state.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/json_reader.hpp"
#include "job/fit_checkpoint.hpp"

namespace matterfit::job {

/// Where a fit stands: all that the next iteration depends on.
// NOLINTNEXTLINE(bugprone-exception-escape): of the JSON library's moves it cannot tell
struct FitState {
  std::string input_hash;
  Inputs inputs;
  std::vector<fit::LawState> laws;
  std::vector<Json> models;  ///< the entry of each in `models`, once it is done; else null
  std::size_t law = 0;       ///< that is being fitted
  Json before;               ///< errors at the start values; null: could not be simulated
  std::string before_failed;
  bool measured_before = false;
  std::vector<Json> history;
  std::vector<std::string> statements;  ///< made along the way
  double seconds = 0.0;                 ///< spent so far
};

/// A search as JSON, numbers to the last bit, without its Jacobian; and back. The latter throws
/// Json::exception where something is missing.
[[nodiscard]] Json search_json(const fit::LeastSquaresState& state);
[[nodiscard]] fit::LeastSquaresState search_of(const Json& json);

/// JSON with numbers to the last bit, so that a fit that reads it goes on as if it had never
/// been stopped. The Jacobian is left out: it is made again.
[[nodiscard]] std::string format_fit_state(const FitState& state);

/// Nothing if it is missing, damaged or of other inputs than `input_hash` (empty: of any).
[[nodiscard]] std::optional<FitState> read_fit_state(const std::filesystem::path& folder,
                                                     const std::string& input_hash);

}  // namespace matterfit::job
