// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/metrics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_set>

#include "base/error.hpp"
#include "fit/data/nearest.hpp"

namespace matterfit::fit {
namespace {

struct SplitMix64 {
  std::uint64_t state;
  std::uint64_t next() {
    std::uint64_t z = (state += 0x9e3779b97f4a7c15ULL);
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
  }
  /// Uniform in [0, bound).
  std::uint64_t below(std::uint64_t bound) {
    const std::uint64_t limit = std::numeric_limits<std::uint64_t>::max() -
                                std::numeric_limits<std::uint64_t>::max() % bound;
    std::uint64_t value = next();
    while (value >= limit) value = next();
    return value % bound;
  }
};

Points finite_points(std::span<const Vec3d> points, const char* which) {
  Points kept;
  kept.reserve(points.size());
  for (const Vec3d& x : points) {
    if (x.allFinite()) kept.push_back(x);
  }
  if (kept.empty())
    throw_input(std::string("the distance of two sets of points: the ") + which +
                " set has no point.");
  return kept;
}

Points thinned(Points points, std::size_t count, std::uint64_t seed) {
  if (points.size() <= count) return points;
  Points kept;
  kept.reserve(count);
  for (const std::size_t i : draw(points.size(), count, seed)) kept.push_back(points[i]);
  return kept;
}

double one_way(const Points& from, const Points& to, Arena& arena) {
  double sum = 0.0;
  for (const Nearest& neighbour : nearest(from, to, arena)) sum += neighbour.squared;
  return sum / double(from.size());
}

}  // namespace

std::vector<std::size_t> draw(std::size_t size, std::size_t count, std::uint64_t seed) {
  count = std::min(count, size);
  std::vector<std::size_t> chosen;
  chosen.reserve(count);
  std::unordered_set<std::size_t> taken;
  SplitMix64 random{seed};
  for (std::size_t j = size - count; j < size; ++j) {
    const auto candidate = static_cast<std::size_t>(random.below(j + 1));
    const std::size_t pick = taken.insert(candidate).second ? candidate : j;
    if (pick == j) taken.insert(j);
    chosen.push_back(pick);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

double chamfer(std::span<const Vec3d> a, std::span<const Vec3d> b, Arena& arena,
               const SetDistanceOptions& options) {
  const Points first = thinned(finite_points(a, "first"), options.limit, options.seed);
  const Points second = thinned(finite_points(b, "second"), options.limit, options.seed + 1);
  return one_way(first, second, arena) + one_way(second, first, arena);
}

std::vector<std::size_t> assign(std::span<const double> cost, std::size_t n,
                                const Interrupter& interrupter) {
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  constexpr double kFar = std::numeric_limits<double>::infinity();
  std::vector<double> column_price(n, 0.0);
  std::vector<std::size_t> row_of(n, kNone);
  std::vector<std::size_t> column_of(n, kNone);
  // Column reduction: each column is offered to the row that is cheapest for it.
  for (std::size_t j = n; j-- > 0;) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < n; ++i) {
      if (cost[i * n + j] < cost[best * n + j]) best = i;
    }
    column_price[j] = cost[best * n + j];
    if (column_of[best] == kNone) {
      column_of[best] = j;
      row_of[j] = best;
    }
  }
  // Augmenting row reduction: lowers prices so that few rows are left for the search below.
  std::vector<std::size_t> free_rows;
  for (std::size_t i = 0; i < n; ++i) {
    if (column_of[i] == kNone) free_rows.push_back(i);
  }
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<std::size_t> still_free;
    std::vector<std::size_t> queue(free_rows.rbegin(), free_rows.rend());
    std::size_t budget = 8 * n;  // ties could otherwise swap two rows for ever
    while (!queue.empty()) {
      interrupter.check();
      const std::size_t i = queue.back();
      queue.pop_back();
      double smallest = kFar;
      double second = kFar;
      std::size_t j1 = 0;
      for (std::size_t j = 0; j < n; ++j) {
        const double reduced = cost[i * n + j] - column_price[j];
        if (reduced < smallest) {
          second = smallest;
          smallest = reduced;
          j1 = j;
        } else if (reduced < second) {
          second = reduced;
        }
      }
      const std::size_t owner = row_of[j1];
      const bool strict = second > smallest && second < kFar;
      if (owner != kNone && (!strict || budget == 0)) {
        still_free.push_back(i);
        continue;
      }
      if (budget > 0) --budget;
      if (strict) column_price[j1] -= second - smallest;
      row_of[j1] = i;
      column_of[i] = j1;
      if (owner != kNone) {
        column_of[owner] = kNone;
        queue.push_back(owner);
      }
    }
    free_rows = std::move(still_free);
  }
  // Shortest augmenting paths (Dijkstra over reduced costs) for the rest.
  std::vector<double> distance(n);
  std::vector<std::size_t> parent(n);
  std::vector<char> done(n);
  for (const std::size_t start : free_rows) {
    interrupter.check();
    std::fill(done.begin(), done.end(), char{0});
    for (std::size_t j = 0; j < n; ++j) {
      distance[j] = cost[start * n + j] - column_price[j];
      parent[j] = start;
    }
    std::vector<std::size_t> settled;
    std::size_t end = kNone;
    double shortest = 0.0;
    while (end == kNone) {
      std::size_t j1 = kNone;
      for (std::size_t j = 0; j < n; ++j) {
        if (done[j] == 0 && (j1 == kNone || distance[j] < distance[j1])) j1 = j;
      }
      shortest = distance[j1];
      done[j1] = 1;
      if (row_of[j1] == kNone) {
        end = j1;
        break;
      }
      settled.push_back(j1);
      const std::size_t i = row_of[j1];
      const double base = cost[i * n + j1] - column_price[j1];
      for (std::size_t j = 0; j < n; ++j) {
        if (done[j] != 0) continue;
        const double through = shortest + (cost[i * n + j] - column_price[j] - base);
        if (through < distance[j]) {
          distance[j] = through;
          parent[j] = i;
        }
      }
    }
    for (const std::size_t j : settled) column_price[j] += distance[j] - shortest;
    std::size_t j = end;
    for (;;) {
      const std::size_t i = parent[j];
      row_of[j] = i;
      std::swap(column_of[i], j);
      if (i == start) break;
    }
  }
  return column_of;
}

double earth_mover(std::span<const Vec3d> a, std::span<const Vec3d> b,
                   const Interrupter& interrupter, const SetDistanceOptions& options) {
  Points first = finite_points(a, "first");
  Points second = finite_points(b, "second");
  const std::size_t n = std::min({options.limit, first.size(), second.size()});
  first = thinned(std::move(first), n, options.seed);
  second = thinned(std::move(second), n, options.seed + 1);
  std::vector<double> cost(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) cost[i * n + j] = (first[i] - second[j]).norm();
  }
  const auto columns = assign(cost, n, interrupter);
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) sum += cost[i * n + columns[i]];
  return sum / double(n);
}

double quantile(std::vector<double> values, double q) {
  values.erase(std::remove_if(values.begin(), values.end(),
                              [](double value) { return !std::isfinite(value); }),
               values.end());
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const double at = std::clamp(q, 0.0, 1.0) * double(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (values[above] - values[below]) * (at - double(below));
}

double body_size(std::span<const Vec3d> points) {
  Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity());
  Vec3d high = -low;
  for (const Vec3d& x : points) {
    if (!x.allFinite()) continue;
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  return points.empty() ? 0.0 : std::max(0.0, (high - low).maxCoeff());
}

}  // namespace matterfit::fit
