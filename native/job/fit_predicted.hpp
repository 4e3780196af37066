// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "fit/numerics/uncertainty.hpp"
#include "fit/search/law_fit.hpp"
#include "job/documents/json_reader.hpp"

/// How sure the prediction of what is held out is, by the Laplace approximation: values drawn from
/// the normal distribution that the fit's errors and correlations describe, each simulated.
namespace matterfit::job {

/// `count` sets of physical values about `values`, in pairs mirrored at it (an odd count is one
/// more), within bounds: in natural coordinates of the correlations of `known`, each error widened
/// by what the grid makes of the value and by Student's quantile. With at most half as many values
/// as sets the sets have just that covariance. What nothing observes stays. Deterministic in the
/// seed.
[[nodiscard]] std::vector<std::vector<double>> drawn_values(
    const std::vector<fit::Parameter>& parameters, const std::vector<double>& values,
    const fit::Uncertainty& known, int count, std::uint64_t seed);

/// `fit.predicted` (docs/formats.md), of the captures by tracks of which something is held out: one
/// simulation a set, side by side, but of pairs that would take over three times the substeps of
/// the fitted values. Null where nothing is held out, no set differs from the values, or fewer than
/// four could be simulated. Throws Error(kCancelled).
[[nodiscard]] Json predicted_json(fit::LawFit& fit, const fit::LawState& state,
                                  const fit::Uncertainty& known, int draws,
                                  const std::function<void(double)>& progress = {});

}  // namespace matterfit::job
