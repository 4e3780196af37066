// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "job/documents/json_reader.hpp"
#include "material/excitation.hpp"

/// `excited` of a body and of a material file (docs/formats.md): the strains and rates that a fit
/// has seen.
namespace matterfit::job {

/// {"strain", "compression", "expansion", "rates": [slowest, fastest]}.
[[nodiscard]] Json excitation_json(const material::Excitation& over);
/// The opposite. Throws Error(kInput) with the path of what is missing, unknown or out of range.
[[nodiscard]] material::Excitation read_excitation(const JsonValue& value);

}  // namespace matterfit::job
