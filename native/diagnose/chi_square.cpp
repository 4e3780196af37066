// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/chi_square.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace matterfit::diagnose {
namespace {

/// ln erfc(z) for z >= 0: by the asymptotic series where erfc underflows.
double log_erfc(double z) {
  if (z < 20.0) return std::log(std::erfc(z));
  const double s = 1.0 / (2.0 * z * z);
  return -z * z - std::log(z * std::sqrt(std::numbers::pi)) + std::log1p(-s + 3.0 * s * s);
}

double log_sum(double a, double b) {
  const double high = std::max(a, b);
  return high + std::log(std::exp(a - high) + std::exp(b - high));
}

}  // namespace

double log_chi_square_tail(double x, int freedom) {
  if (!(x > 0.0)) return 0.0;
  const double half = 0.5 * x;
  // Q(a, y) = Q(a − 1, y) + y^(a−1) e^−y / Γ(a), from a = ½ or 1.
  const bool odd = freedom % 2 == 1;
  double a = odd ? 0.5 : 1.0;
  double result = odd ? log_erfc(std::sqrt(half)) : -half;
  while (a + 0.5 < 0.5 * freedom) {
    a += 1.0;
    result = log_sum(result, (a - 1.0) * std::log(half) - half - std::lgamma(a));
  }
  return std::min(result, 0.0);
}

double equivalent_of_one(double x, int freedom) {
  if (freedom == 1 || !(x > 0.0)) return std::max(x, 0.0);
  const double target = log_chi_square_tail(x, freedom);
  // Fewer degrees of freedom need a smaller value for the same tail.
  double low = 0.0;
  double high = x;
  for (int i = 0; i < 200 && high - low > 1e-12 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (log_chi_square_tail(middle, 1) > target ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace matterfit::diagnose
