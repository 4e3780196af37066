// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "job/run/capture_input.hpp"
#include "job/run/observe.hpp"

namespace matterfit::job {

/// The error of a simulation against one capture, for every point and frame, and in sum.
struct CaptureError {
  std::vector<double> error_mm;  ///< (T, N); NaN where not seen or not simulated
  Json summary;                  ///< docs/formats.md, "The result"
};

/// Distance of each simulated point from the captured one [mm], (T, N); NaN where not seen or not
/// simulated.
[[nodiscard]] std::vector<double> capture_error_mm(const fit::CaptureInput& capture,
                                                   const fit::SimulatedCapture& simulated);

/// `samples`, and of those that are there `mean_mm`, `rms_mm`, `p95_mm`, `max_mm`.
[[nodiscard]] Json error_statistics(const std::vector<double>& error_mm);

/// Distances between simulated and captured points: mean, 95th percentile, largest, in mm and in
/// percent of `body_size` [m]; by point, by frame, on held-out points and frames apart; the Chamfer
/// distance of each frame, and the earth mover's distance of each frame (of eight evenly spaced
/// ones where there are more than 128 points).
[[nodiscard]] CaptureError compare_capture(const fit::CaptureInput& capture,
                                           const fit::SimulatedCapture& simulated, double body_size,
                                           double fps, int first_frame, Arena& arena,
                                           const Interrupter& interrupter);

/// Writes `compare.npz` (of several captures `compare_NAME.npz`): error_mm (T,N), times (T,),
/// captured (T,N,3) in the world [m], NaN where not seen, labels; returns its name.
[[nodiscard]] std::string write_compare(const std::filesystem::path& folder,
                                        const fit::CaptureInput& capture, const CaptureError& error,
                                        bool only_one);

}  // namespace matterfit::job
