// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "capture/swaps.hpp"
#include "job/documents/document.hpp"

/// Tracks that a tracker took for each other: seen in the recording alone, without a simulation.
namespace matterfit::job {

/// What was found in one capture.
struct SwappedTracks {
  std::size_t capture = 0;  ///< into Job::captures
  std::string name;         ///< its
  std::vector<capture::Swap> swaps;
  std::vector<std::string> labels;  ///< "Tip-1 and Tip-2 from sample 7 on", one a swap
};

/// In all captures of a job, those with any. Throws Error(kInput) where one cannot be read.
[[nodiscard]] std::vector<SwappedTracks> find_swapped_tracks(const Job& job);

/// Puts what was found into a document's captures (`swaps`), so that they are read as they were.
void write_swaps(const std::vector<SwappedTracks>& found, Json& document);

/// Adds them to a report (report_json()) as causes of measurement that were undone before anything
/// was fitted. With another cause the verdict is
/// `several`, where there is none `measurement`; what is unknown stays so.
void report_swaps(const std::vector<SwappedTracks>& found, Json& report);

}  // namespace matterfit::job
