// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/student.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace matterfit::fit {
namespace {

/// Γ(x + ½)/Γ(x), x > 0: Stirling's series where x is large.
double ratio_of_gammas(double x) {
  double factor = 1.0;
  while (x < 30.0) {
    factor *= x / (x + 0.5);
    x += 1.0;
  }
  const double y = 1.0 / (8.0 * x);
  return factor * std::sqrt(x) * (1.0 - y * (1.0 - y * (0.5 + y * (2.5 - 2.625 * y))));
}

/// ∫ cosᵏ from 0 to `end` by Simpson's rule.
double integral(double k, double end) {
  constexpr int kParts = 128;
  double sum = 1.0 + std::pow(std::cos(end), k);
  for (int i = 1; i < kParts; ++i) {
    sum += (i % 2 == 0 ? 2.0 : 4.0) * std::pow(std::cos(end * i / kParts), k);
  }
  return sum * end / (3.0 * kParts);
}

}  // namespace

double student_quantile(double freedom) {
  constexpr double kMost = 1e6;  // from here on it is the normal distribution's
  if (!(freedom < kMost)) return kNormalQuantile;
  freedom = std::max(1.0, freedom);
  // With t = √ν tan θ the probability of 0 … t is c ∫ cos^(ν−1) over 0 … θ.
  const double c = ratio_of_gammas(0.5 * freedom) / std::sqrt(std::numbers::pi);
  double low = 0.0;
  double high = std::atan(13.0 / std::sqrt(freedom));
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (c * integral(freedom - 1.0, middle) < 0.475 ? low : high) = middle;
  }
  return std::sqrt(freedom) * std::tan(0.5 * (low + high));
}

}  // namespace matterfit::fit
