// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "job/json_reader.hpp"

namespace matterfit::job {

/// Applies one `--set path=value` to a document. Steps of a path are keys, `[index]`, or, within a
/// list of named objects (bodies, colliders, probes, captures), a name: `scene.gravity`,
/// `scene.bodies.dough.material.E`, `scene.bodies[0].density`, `captures[0].noise`. A name with
/// dots stands in quotes: `scene.bodies."my.dough".density`. `bodies`, `colliders` and `material`
/// (with one body), `gravity`, `fps`, `frames`, `particle_separation` and `solver` may leave out
/// `scene.`. The value is JSON; what does not parse as JSON is taken as a text. Throws
/// Error(kInput).
void apply_override(Json& document, const std::string& assignment);

}  // namespace matterfit::job
