// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/matte_region.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace matterfit::capture {

double keep_largest_region(std::vector<std::uint8_t>& matte, int width, int height) {
  std::vector<int> region(matte.size(), -1);
  std::vector<std::size_t> sizes;
  std::vector<std::size_t> open;
  for (std::size_t seed = 0; seed < matte.size(); ++seed) {
    if (matte[seed] < kHalfCovered || region[seed] >= 0) continue;
    const int name = static_cast<int>(sizes.size());
    sizes.push_back(0);
    region[seed] = name;
    open.assign(1, seed);
    while (!open.empty()) {
      const std::size_t at = open.back();
      open.pop_back();
      ++sizes.back();
      for_neighbours(at, width, height, [&](std::size_t next) {
        if (matte[next] < kHalfCovered || region[next] >= 0) return;
        region[next] = name;
        open.push_back(next);
      });
    }
  }
  if (sizes.empty()) {
    std::fill(matte.begin(), matte.end(), std::uint8_t{0});
    return 1.0;
  }
  const auto largest =
      static_cast<int>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  for (std::size_t i = 0; i < matte.size(); ++i) {
    if (matte[i] == 0 || region[i] == largest) continue;
    bool beside = false;
    for_neighbours(i, width, height,
                   [&](std::size_t next) { beside = beside || region[next] == largest; });
    if (!beside || region[i] >= 0) matte[i] = 0;
  }
  const std::size_t all = std::accumulate(sizes.begin(), sizes.end(), std::size_t{0});
  return double(sizes[std::size_t(largest)]) / double(all);
}

}  // namespace matterfit::capture
