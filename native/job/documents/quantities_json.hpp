// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// The table of quantities (fit/model/quantity.hpp), the laws with their parameters, the neural
/// start laws that the library carries, and the effects that a document may list, for panels and
/// scripts: {"quantities": [{"path", "owner", "list", "size", "unit", "coordinate", "scale",
/// "bounds", "around", "prior_sigma", "usual", "stiffness", "of_law", "gradient", "label",
/// "sentence"}, …], "laws": [{"name", "label", "parameters", "flows"}, …], "starts": [{"name",
/// "numbers": {"E", …}}, …], "effects": [{"name", "parameters": [{"key", "unit", "size", "bounds",
/// "keyed"}, …]}, …], "usual_factor", "never_strain", "liquid_strain", "most_branches"}. `scale` is
/// null where it is the scene's particle separation, `bounds` where they lie `usual_factor` either
/// side of the start.
[[nodiscard]] Json quantities_json();

}  // namespace matterfit::job
