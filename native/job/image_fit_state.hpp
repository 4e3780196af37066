// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "fit/numerics/least_squares.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// What a fit to images does, one after another.
enum class ImagePhase : int {
  kPosesWide,    ///< poses of cameras by the first frame, images blurred widely
  kPosesNarrow,  ///< the same, blurred narrowly
  kThrow,        ///< the throw, by the first images
  kScan,         ///< starts of what is scanned
  kWide,         ///< everything, by all images blurred widely
  kNarrow,       ///< the same, blurred narrowly
  kDone,         ///< errors of the values are left
};

/// The cost of a simulation of a phase, as a share of one in which all images are drawn.
[[nodiscard]] double cost_of(ImagePhase phase);
/// About how much of a fit's searches is done, 0 to 1: after simulations that cost as much as
/// `simulations` of all images, with so many numbers that are fitted.
[[nodiscard]] double searched_share(double simulations, std::size_t numbers);

/// Where a fit to images stands: all that the next iteration depends on.
// NOLINTNEXTLINE(bugprone-exception-escape): of the JSON library's moves it cannot tell
struct ImageFitState {
  std::string input_hash;
  Inputs inputs;
  ImagePhase phase = ImagePhase::kPosesWide;
  std::vector<double> values;       ///< physical, where the phase, or a beginning of it, began
  std::vector<double> stepped_at;   ///< values by which substeps were chosen last
  std::vector<double> sized_at;     ///< values by which images were reduced last
  std::vector<double> coloured_at;  ///< values at which colours were learnt last; empty: none were
  std::vector<int> refinements;     ///< of the substeps, in the phase's search
  int beginnings = 0;               ///< that the throw was looked for in
  std::optional<double> agreed;     ///< misfit of the last of them that was taken
  std::optional<fit::LeastSquaresState> search;  ///< of the phase
  Json before;                                   ///< agreement at the start values
  std::vector<Json> history;
  int evaluations = 0;     ///< of the phases before
  double simulated = 0.0;  ///< simulations of all phases, in ones of all images
  int iterations = 0;
  double seconds = 0.0;
};

/// The values of the last step of a search that goes on, else where the last one ended.
[[nodiscard]] std::vector<double> best_values(const ImageFitState& state);

/// The same as format_fit_state() and read_fit_state(), in the same file.
[[nodiscard]] std::string format_image_fit_state(const ImageFitState& state);
[[nodiscard]] std::optional<ImageFitState> read_image_fit_state(
    const std::filesystem::path& folder);

}  // namespace matterfit::job
