// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "fit/data/track_motion.hpp"
#include "fit/model/experiment.hpp"
#include "fit/model/parameters.hpp"
#include "fit/search/flow_start.hpp"

namespace matterfit::fit {

/// Where a fit may begin by the momentum balance of its tracks, without a simulation.
struct EquationStart {
  /// To be tried, physical: all that was found, then all but each of it. Empty: it does not apply.
  std::vector<std::vector<double>> candidates;
  /// A sentence: what was found, or why it is not possible.
  std::string statement;
};

/// Frames in a row and evenly spaced, from where the body begins to move, that the fit may see of a
/// capture with tracks of a body of that volume [m³].
[[nodiscard]] InteriorTracks interior_tracks(const Capture& capture, double volume);

/// The parameters of the body's material at which the momentum balance along its interior tracks
/// (fit/data/equation_error.hpp) is missed least, by Levenberg–Marquardt from `values`. What the
/// balance does not determine to a factor of three, or where it runs into a bound, stays as it is.
/// It applies to captures of the only body of a scene, without attached masses, that is not placed
/// anew, with tracks all through it at even times. `scenes` one a run; same result for any number
/// of threads. Throws Error(kCancelled).
[[nodiscard]] EquationStart equation_start(const std::vector<Run>& runs,
                                           const std::vector<mpm::Scene>& scenes,
                                           const Parameters& parameters,
                                           std::span<const double> values, int threads,
                                           const Interrupter& interrupter);

/// The same from each class of flow (flow_starts()), priors of codes kept, for what a simulation is
/// to try first: the candidates are what was found from the three classes in which the balance is
/// likeliest, that one first. It is looked at for sand too, whose pressure it hardly knows, since
/// only simulations decide.
[[nodiscard]] EquationStart rank_classes(const std::vector<Run>& runs,
                                         const std::vector<mpm::Scene>& scenes,
                                         const Parameters& parameters,
                                         const std::vector<FlowStart>& starts, int threads,
                                         const Interrupter& interrupter);

}  // namespace matterfit::fit
