// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "job/diagnosis/causes.hpp"

namespace matterfit::job {

/// Encounters that the used samples show: frames in which the mean acceleration that the simulation
/// lacks is far above that of other frames, and above what its own contacts do. At most two, the
/// clearest first. `simulated` [m]: positions of all samples of the captures, as Motion::positions.
[[nodiscard]] std::vector<Encounter> encounters(const std::vector<diagnose::Capture>& captures,
                                                const Eigen::VectorXd& simulated,
                                                const Vec3d& gravity);

/// A plane or a sphere at one of the encounters. Its numbers: how far it reaches into where the
/// body would pass [m], 0: not at all; two angles [rad] between its normal and the impulse that
/// showed it, in which its friction has a part; and that friction. Nothing where there are none.
[[nodiscard]] std::optional<Cause> hidden_collider(const std::vector<Encounter>& encounters,
                                                   const mpm::Scene& scene);

}  // namespace matterfit::job
