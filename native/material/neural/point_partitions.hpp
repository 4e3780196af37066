// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "base/parallel.hpp"

namespace matterfit::material {

/// Points are dealt to threads in this many partitions at most, so that sums over points are the
/// same for any number of threads.
inline constexpr std::size_t kPointPartitions = 32;
/// Points of a partition are a multiple of this: whole batches of panels on every SIMD target.
inline constexpr std::size_t kPartitionPoints = 128;

[[nodiscard]] inline std::size_t partition_count(std::size_t points) {
  return std::min(kPointPartitions, (points + kPartitionPoints - 1) / kPartitionPoints);
}

/// Calls body(partition, begin, end) for the partitions of [0, points).
template <class Body>
void for_partitions(std::size_t points, Arena& arena, const Body& body) {
  const std::size_t batches = (points + kPartitionPoints - 1) / kPartitionPoints;
  const std::size_t parts = partition_count(points);
  arena.parallel_for(0, parts, 1, [&](std::size_t part) {
    const std::size_t begin = batches * part / parts * kPartitionPoints;
    const std::size_t end = std::min(batches * (part + 1) / parts * kPartitionPoints, points);
    body(part, begin, end);
  });
}

/// total[i] = Σ over partitions, in their order; `partial` is [partitions, total.size()].
template <class S>
void sum_partitions(std::span<const S> partial, std::span<double> total) {
  std::fill(total.begin(), total.end(), 0.0);
  for (std::size_t at = 0; at < partial.size(); at += total.size()) {
    const S* from = partial.data() + at;
    for (std::size_t i = 0; i < total.size(); ++i) total[i] += static_cast<double>(from[i]);
  }
}

}  // namespace matterfit::material
