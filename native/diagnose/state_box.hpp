// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>

#include "diagnose/study.hpp"
#include "fit/numerics/bounded_step.hpp"

namespace matterfit::diagnose {

/// The scales of [θ | α], the numbers of a state.
[[nodiscard]] Eigen::VectorXd scales_of(const Model& model, const State& state);

/// Where [θ | α] may lie: natural coordinates and physical values.
[[nodiscard]] fit::Box box_of(const Model& model, const State& state);

/// Steps from `values` within `bounds`, in scales: 0 is one of them, and none is of over a million.
[[nodiscard]] fit::Box room_about(const Eigen::VectorXd& values, const fit::Box& bounds,
                                  const Eigen::VectorXd& scales);

}  // namespace matterfit::diagnose
