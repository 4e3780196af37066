// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/bounded_step.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

enum class Side : std::uint8_t { kFree, kLow, kHigh };

/// Direction in the free components from `s` to the minimiser over them, 0 in the others.
VectorXd direction(const MatrixXd& a, const VectorXd& slope, const std::vector<Side>& side) {
  std::vector<Index> free;
  for (Index k = 0; k < slope.size(); ++k) {
    if (side[std::size_t(k)] == Side::kFree) free.push_back(k);
  }
  VectorXd step = VectorXd::Zero(slope.size());
  if (free.empty()) return step;
  const MatrixXd reduced = a(free, free);
  const VectorXd right = slope(free);
  const VectorXd solution = reduced.ldlt().solve(right);
  if (!solution.allFinite()) return step;
  step(free) = -solution;
  return step;
}

}  // namespace

VectorXd bounded_step(const MatrixXd& a, const VectorXd& g, const Box& box) {
  const Index n = g.size();
  VectorXd s = VectorXd::Zero(n);
  std::vector<Side> side(std::size_t(n), Side::kFree);
  for (Index k = 0; k < n; ++k) {
    if (box.low[k] >= 0.0 && g[k] > 0.0) side[std::size_t(k)] = Side::kLow;
    if (box.high[k] <= 0.0 && g[k] < 0.0) side[std::size_t(k)] = Side::kHigh;
  }
  // Each pass that is not blocked lowers the function, so no set of sides comes twice; the limit is
  // for rounding.
  for (Index pass = 0; pass < 20 * (n + 1); ++pass) {
    const VectorXd step = direction(a, g + a * s, side);
    double length = 1.0;
    Index blocking = -1;
    for (Index k = 0; k < n; ++k) {
      const double bound = step[k] < 0.0 ? box.low[k] : box.high[k];
      if (step[k] == 0.0 || std::isinf(bound)) continue;
      const double room = std::max(0.0, (bound - s[k]) / step[k]);
      if (room < length) {
        length = room;
        blocking = k;
      }
    }
    s += length * step;
    if (blocking >= 0) {
      const bool down = step[blocking] < 0.0;
      s[blocking] = down ? box.low[blocking] : box.high[blocking];
      side[std::size_t(blocking)] = down ? Side::kLow : Side::kHigh;
      continue;
    }
    // Free the bound that pulls inwards most.
    const VectorXd slope = g + a * s;
    const double tolerance =
        1e-12 * (g.lpNorm<Eigen::Infinity>() + slope.lpNorm<Eigen::Infinity>());
    double most = tolerance;
    Index freed = -1;
    for (Index k = 0; k < n; ++k) {
      const Side at = side[std::size_t(k)];
      const double inwards = at == Side::kLow ? -slope[k] : at == Side::kHigh ? slope[k] : 0.0;
      if (inwards > most) {
        most = inwards;
        freed = k;
      }
    }
    if (freed < 0) break;
    side[std::size_t(freed)] = Side::kFree;
  }
  return s.cwiseMax(box.low).cwiseMin(box.high);
}

}  // namespace matterfit::fit
