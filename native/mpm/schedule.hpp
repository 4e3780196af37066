// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

namespace matterfit::mpm {

/// How a frame was stepped: what the solver found before it began, and a gradient takes as given.
struct FrameSchedule {
  int substeps = 0;  ///< at least 1
  /// Substep that the unforced body could take [s], of each total Lagrangian body: the smoothing of
  /// its velocities is measured by it. 0: held so far.
  std::vector<double> elastic_dt;
  /// Ends of substeps at which the reference of renewed bodies was renewed, as shares of the frame;
  /// nothing: where motion asks for it. Where motion is far from the schedule's they are renewed at
  /// other times as well.
  std::optional<std::vector<double>> renewals = std::nullopt;
};

/// The schedules of a run's frames, from the first on. A run with another's schedule takes the same
/// steps.
using Schedule = std::vector<FrameSchedule>;

}  // namespace matterfit::mpm
