// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/colour_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>

namespace matterfit::fit {
namespace {

constexpr double kWindow = 1.5;  // [pixels]
constexpr double kLuminance = 0.01 * 0.01;
constexpr double kContrast = 0.03 * 0.03;
constexpr double kLeastSquare = 1e-12;

/// Means in the windows of what `value` is at a pixel, over those that are compared.
class Means {
 public:
  explicit Means(const Coverage& compared) : compared_(compared), weight_(compared) {
    blur(weight_, kWindow);
  }

  [[nodiscard]] Coverage of(const std::function<float(std::size_t)>& value) const {
    Coverage mean = compared_;
    for (std::size_t i = 0; i < mean.values.size(); ++i) {
      mean.values[i] = compared_.values[i] > 0.0F ? value(i) : 0.0F;
    }
    blur(mean, kWindow);
    for (std::size_t i = 0; i < mean.values.size(); ++i) {
      if (compared_.values[i] > 0.0F) mean.values[i] /= weight_.values[i];
    }
    return mean;
  }

 private:
  const Coverage& compared_;
  Coverage weight_;
};

}  // namespace

ColourAgreement colour_agreement(const std::array<Coverage, 3>& one,
                                 const std::array<Coverage, 3>& other, const Coverage& compared) {
  const Means means(compared);
  double squares = 0.0;
  double similar = 0.0;
  double count = 0.0;
  for (std::size_t c = 0; c < one.size(); ++c) {
    const std::vector<float>& a = one[c].values;
    const std::vector<float>& b = other[c].values;
    const Coverage mean_a = means.of([&](std::size_t i) { return a[i]; });
    const Coverage mean_b = means.of([&](std::size_t i) { return b[i]; });
    const Coverage square_a = means.of([&](std::size_t i) { return a[i] * a[i]; });
    const Coverage square_b = means.of([&](std::size_t i) { return b[i] * b[i]; });
    const Coverage product = means.of([&](std::size_t i) { return a[i] * b[i]; });
    for (std::size_t i = 0; i < compared.values.size(); ++i) {
      if (!(compared.values[i] > 0.0F)) continue;
      const double apart = double(a[i]) - double(b[i]);
      squares += apart * apart;
      const double x = double(mean_a.values[i]);
      const double y = double(mean_b.values[i]);
      const double variances = std::max(0.0, double(square_a.values[i]) - x * x) +
                               std::max(0.0, double(square_b.values[i]) - y * y);
      const double covariance = double(product.values[i]) - x * y;
      similar += (2.0 * x * y + kLuminance) * (2.0 * covariance + kContrast) /
                 ((x * x + y * y + kLuminance) * (variances + kContrast));
      count += 1.0;
    }
  }
  if (!(count > 0.0)) return {};
  return {-10.0 * std::log10(std::max(kLeastSquare, squares / count)), similar / count};
}

}  // namespace matterfit::fit
