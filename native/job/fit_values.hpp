// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "fit/model/parameters.hpp"
#include "job/fit_experiment.hpp"

namespace matterfit::job {

/// Sets the values of a fit's numbers in the job's document, `captures[].scene` included. `sources`
/// are those of the parameters' runs.
void write_values(const fit::Parameters& parameters, std::span<const double> values,
                  const std::vector<RunSource>& sources, const Job& job, Json& document);

/// Gives the bodies of `document` whose weights, code or correction are among the parameters a list
/// of zeros for them, where they have none.
void add_lists(const fit::Parameters& parameters, Json& document);

}  // namespace matterfit::job
