// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "base/parallel.hpp"
#include "base/vec.hpp"

namespace matterfit::fit {

/// The nearest point of another set.
struct Nearest {
  std::size_t index = 0;
  double squared = 0.0;  ///< distance [m²]
};

/// For each point of `from` the nearest of `to`, by a k-d tree. Finite points only, `to` not empty.
/// Same result for any number of threads.
[[nodiscard]] std::vector<Nearest> nearest(const Points& from, const Points& to, Arena& arena);

}  // namespace matterfit::fit
