// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "job/documents/json_reader.hpp"

namespace matterfit::job {

/// One step of a path such as scene.bodies."my.dough".velocity[2].
struct PathStep {
  std::string key;
  bool is_index = false;  ///< it stood in [ ]
  std::size_t index = 0;
};

/// Takes a path apart; a key with dots stands in quotes. Throws Error(kInput) beginning with
/// `where`.
[[nodiscard]] std::vector<PathStep> parse_path(const std::string& path, const std::string& where);

/// Applies one `--set path=value` to a document. Steps of a path are keys, `[index]`, or, within a
/// list of named objects (bodies, colliders, probes, captures), a name: `scene.gravity`,
/// `scene.bodies.dough.material.E`, `scene.bodies[0].density`, `captures[0].noise`. A name with
/// dots stands in quotes: `scene.bodies."my.dough".density`. `bodies`, `colliders` and `material`
/// (with one body), `gravity`, `fps`, `frames`, `particle_separation` and `solver` may leave out
/// `scene.`. The value is JSON; what does not parse as JSON is taken as a text. Throws
/// Error(kInput).
void apply_override(Json& document, const std::string& assignment);

}  // namespace matterfit::job
