// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "fit/model/experiment.hpp"

namespace matterfit::fit {

/// The first part of all captures: how long each run is simulated and compared.
struct Window {
  std::vector<double> until;  ///< [s] of each run; negative: not simulated
  int first_frame = 0;        ///< of the first fitted run, for names
  int last_frame = 0;
};

/// Windows that double, from a few samples after the motion begins to all that are used; only the
/// last where `grow` is off.
[[nodiscard]] std::vector<Window> growing_windows(const std::vector<Run>& runs, bool grow);
/// At most `samples` used times of each run.
[[nodiscard]] Window first_window(const std::vector<Run>& runs, std::size_t samples);

}  // namespace matterfit::fit
