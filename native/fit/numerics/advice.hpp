// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace matterfit::fit {

/// What a parameter is in words, and what a recording needs to show of it.
struct Advice {
  std::string quantity;  ///< "the stiffness"
  std::string record;    ///< completes "To see it, record …"
};

/// For a parameter's JSON path, "bodies.dough.material.E" or "velocity[2]".
[[nodiscard]] Advice advice(const std::string& path);

}  // namespace matterfit::fit
