// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/gradient_record.hpp"

#include <cmath>
#include <sstream>

#include "base/error.hpp"

namespace matterfit::mpm {

std::size_t least_record(std::size_t substeps, std::size_t state_bytes, std::size_t other,
                         std::size_t first_interval) {
  std::size_t least = std::numeric_limits<std::size_t>::max();
  std::size_t interval = first_interval;
  do {
    const std::size_t kept = (substeps + interval - 1) / interval;
    least = std::min(least, other + (kept + std::min(interval, substeps) - 1) * state_bytes);
    interval *= 2;
  } while (interval / 2 < substeps);
  return least;
}

void throw_over_budget(std::size_t budget, std::size_t substeps, std::size_t state_bytes,
                       std::size_t other, std::size_t first_interval) {
  const std::size_t least = least_record(substeps, state_bytes, other, first_interval);
  constexpr double kMegabyte = 1024.0 * 1024.0;
  const auto tenths = [](double megabytes) { return std::ceil(10.0 * megabytes) / 10.0; };
  std::ostringstream text;
  text << "The gradient's memory budget of " << static_cast<double>(budget) / kMegabyte
       << " MB cannot hold this run: about " << substeps << " substeps with states of "
       << tenths(static_cast<double>(state_bytes) / kMegabyte) << " MB need "
       << tenths(static_cast<double>(least) / kMegabyte)
       << " MB at least. Raise the budget, or use fewer frames, fewer substeps or a larger "
          "particle separation.";
  throw_input(text.str());
}

}  // namespace matterfit::mpm
