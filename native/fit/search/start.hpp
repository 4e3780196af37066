// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "fit/model/experiment.hpp"
#include "fit/model/parameters.hpp"

/// Where a fit begins.
namespace matterfit::fit {

/// Values that begin with the motion of the first frames.
struct MotionStart {
  std::vector<double> flights;  ///< where a ballistic flight explains at least three of them
  /// Those, and where it does not the motion from the first frame to the second, in which the body
  /// may have met something.
  std::vector<double> guesses;
  std::vector<std::string> contradicted;  ///< captures that `guesses` takes more from
};

/// The values with velocity and spin replaced, where they are among the parameters, by those of the
/// rigid motion through the first frames of a capture of that body (fit/data/initial_motion.hpp):
/// as many frames as a ballistic flight explains, two where there are no more; of clouds the
/// velocity alone, by the mean of a frame's points. A later capture of the body counts where an
/// earlier one shows no flight. Bodies with pins stay. `scenes` one a run; noise settled
/// (settle_noise()).
[[nodiscard]] MotionStart with_initial_motion(const std::vector<Run>& runs,
                                              const std::vector<mpm::Scene>& scenes,
                                              const Parameters& parameters,
                                              std::span<const double> values);

/// Cost of each of the points; infinite where a simulation could not be completed.
using Costs = std::function<std::vector<double>(const std::vector<std::vector<double>>&)>;

struct Scanned {
  std::vector<double> values;
  double cost = 0.0;
};

/// The best of a search along one parameter after the other, half a decade a step (friction angles
/// 8°): stiffness (where ν is fitted too, then the bulk modulus alone: a ratio that is far off
/// makes it wrong by decades), yield stress, friction angle, viscosity. Twice where there are
/// several. `cost` is that of `values`; it goes `farthest` steps either way at most, both ways as
/// long as no simulation could be completed. `finely`: at the end by quarters of these steps.
/// `also`: numbers of further parameters that are looked along.
[[nodiscard]] Scanned scanned(const Parameters& parameters, std::vector<double> values, double cost,
                              const Costs& costs, int farthest = 8, bool finely = false,
                              std::span<const std::size_t> also = {});

}  // namespace matterfit::fit
