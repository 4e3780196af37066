// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/matte_region.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <numeric>

namespace matterfit::capture {
namespace {

constexpr std::uint8_t kHalf = 128;

}  // namespace

double keep_largest_region(std::vector<std::uint8_t>& matte, int width, int height) {
  std::vector<int> region(matte.size(), -1);
  std::vector<std::size_t> sizes;
  std::vector<std::size_t> open;
  const auto w = static_cast<std::size_t>(width);
  const auto h = static_cast<std::size_t>(height);
  const auto each_neighbour = [&](std::size_t at, const auto& visit) {
    if (at % w > 0) visit(at - 1);
    if (at % w + 1 < w) visit(at + 1);
    if (at >= w) visit(at - w);
    if (at + w < w * h) visit(at + w);
  };
  for (std::size_t seed = 0; seed < matte.size(); ++seed) {
    if (matte[seed] < kHalf || region[seed] >= 0) continue;
    const int name = static_cast<int>(sizes.size());
    sizes.push_back(0);
    region[seed] = name;
    open.assign(1, seed);
    while (!open.empty()) {
      const std::size_t at = open.back();
      open.pop_back();
      ++sizes.back();
      each_neighbour(at, [&](std::size_t next) {
        if (matte[next] < kHalf || region[next] >= 0) return;
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
    each_neighbour(i, [&](std::size_t next) { beside = beside || region[next] == largest; });
    if (!beside || region[i] >= 0) matte[i] = 0;
  }
  const std::size_t all = std::accumulate(sizes.begin(), sizes.end(), std::size_t{0});
  return double(sizes[std::size_t(largest)]) / double(all);
}

std::vector<int> distances_from(const std::vector<std::uint8_t>& region, int width, int height,
                                int most) {
  const auto w = static_cast<std::size_t>(width);
  std::vector<int> distances(region.size(), most + 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (region[std::size_t(y) * w + std::size_t(x)] < kHalf) continue;
      for (int j = std::max(0, y - most); j <= std::min(height - 1, y + most); ++j) {
        for (int i = std::max(0, x - most); i <= std::min(width - 1, x + most); ++i) {
          int& own = distances[std::size_t(j) * w + std::size_t(i)];
          own = std::min(own, std::max(std::abs(i - x), std::abs(j - y)));
        }
      }
    }
  }
  return distances;
}

}  // namespace matterfit::capture
