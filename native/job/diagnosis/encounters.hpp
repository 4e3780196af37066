// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "job/diagnosis/causes.hpp"

namespace matterfit::job {

/// What the used samples show that the simulation lacks, for a while. First at most two that turn
/// the body within a frame or two, the clearest first: frames in which the mean acceleration that
/// the simulation lacks is far above that of other frames, and above what its own contacts do. Then
/// at most one that lasts three frames or more and has no contact in it (Encounter::lasts > 0).
/// `simulated` [m]: positions of all samples of the captures, as Motion::positions.
[[nodiscard]] std::vector<Encounter> encounters(const std::vector<diagnose::Capture>& captures,
                                                const Eigen::VectorXd& simulated,
                                                const Vec3d& gravity);

}  // namespace matterfit::job
