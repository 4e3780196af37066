// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/silhouette.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <numbers>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

constexpr double kReach = 3.0;  // of a blur, in standard deviations
constexpr std::uint8_t kHalf = 128;

std::size_t pixels_of(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

std::vector<float> weights_of(double deviation) {
  const auto reach = std::max<std::ptrdiff_t>(1, std::llround(std::ceil(kReach * deviation)));
  std::vector<float> weights(static_cast<std::size_t>(2 * reach + 1));
  double sum = 0.0;
  for (std::ptrdiff_t i = -reach; i <= reach; ++i) {
    const double w = std::exp(-0.5 * double(i * i) / (deviation * deviation));
    weights[static_cast<std::size_t>(i + reach)] = static_cast<float>(w);
    sum += w;
  }
  for (float& w : weights) w /= static_cast<float>(sum);
  return weights;
}

/// One pass: `count` lines of `length` pixels, `along` apart in a line, `across` between lines.
void blur_lines(const std::vector<float>& from, std::vector<float>& into,
                const std::vector<float>& weights, std::ptrdiff_t count, std::ptrdiff_t length,
                std::ptrdiff_t across, std::ptrdiff_t along) {
  const auto reach = static_cast<std::ptrdiff_t>(weights.size() / 2);
  for (std::ptrdiff_t line = 0; line < count; ++line) {
    for (std::ptrdiff_t i = 0; i < length; ++i) {
      float sum = 0.0F;
      const std::ptrdiff_t low = std::max(-reach, -i);
      const std::ptrdiff_t high = std::min(reach, length - 1 - i);
      for (std::ptrdiff_t k = low; k <= high; ++k) {
        sum += weights[static_cast<std::size_t>(k + reach)] *
               from[static_cast<std::size_t>(line * across + (i + k) * along)];
      }
      into[static_cast<std::size_t>(line * across + i * along)] = sum;
    }
  }
}

using OutlinePoints = std::vector<Eigen::Vector2f>;

/// The points of an outline, for a tree.
struct Outline {
  const OutlinePoints& points;

  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<int>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};
using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Outline>, Outline, 2>;

/// Where a value crosses ½ between neighbours, to a fraction of a pixel.
template <class Value>
OutlinePoints outline_of(const Value& value, int width, int height) {
  OutlinePoints outline;
  const auto between = [&](int x, int y, int x2, int y2) {
    const float a = value(x, y) - 0.5F;
    const float b = value(x2, y2) - 0.5F;
    if ((a >= 0.0F) == (b >= 0.0F)) return;
    const float t = a / (a - b);
    outline.emplace_back(float(x) + t * float(x2 - x), float(y) + t * float(y2 - y));
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (x + 1 < width) between(x, y, x + 1, y);
      if (y + 1 < height) between(x, y, x, y + 1);
    }
  }
  return outline;
}

double mean_distance(const OutlinePoints& from, const OutlinePoints& to) {
  const Outline target{to};
  const Tree tree(2, target, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  double sum = 0.0;
  for (const Eigen::Vector2f& point : from) {
    std::uint32_t index = 0;
    float squared = 0.0F;
    tree.knnSearch(point.data(), 1, &index, &squared);
    sum += std::sqrt(static_cast<double>(squared));
  }
  return sum / static_cast<double>(from.size());
}

}  // namespace

Coverage reduced(std::span<const std::uint8_t> matte, int width, int height, int factor) {
  Coverage image;
  image.width = width / factor;
  image.height = height / factor;
  image.values.reserve(pixels_of(image.width, image.height));
  const double scale = 1.0 / (255.0 * factor * factor);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      int sum = 0;
      for (int j = 0; j < factor; ++j) {
        const std::uint8_t* row = matte.data() + std::size_t(y * factor + j) * std::size_t(width);
        for (int i = 0; i < factor; ++i) sum += row[x * factor + i];
      }
      image.values.push_back(static_cast<float>(scale * sum));
    }
  }
  return image;
}

splat::Camera reduced(const splat::Camera& camera, int factor) {
  splat::Camera result = camera;
  result.width = camera.width / factor;
  result.height = camera.height / factor;
  for (double* value : {&result.fx, &result.fy, &result.cx, &result.cy}) *value /= factor;
  return result;
}

Coverage seen_of(const std::vector<float>& mask, const Coverage& matte,
                 const std::vector<float>& seen) {
  Coverage ours{matte.width, matte.height, mask};
  for (std::size_t i = 0; i < seen.size(); ++i) ours.values[i] *= seen[i];
  return ours;
}

void blur(Coverage& image, double deviation) {
  if (!(deviation > 0.0)) return;
  const std::vector<float> weights = weights_of(deviation);
  std::vector<float> rows(image.values.size());
  blur_lines(image.values, rows, weights, image.height, image.width, image.width, 1);
  blur_lines(rows, image.values, weights, image.width, image.height, 1, image.width);
}

double coverage_deviation(double noise, double blur) {
  return noise / std::sqrt(2.0 * std::sqrt(std::numbers::pi) * blur);
}

double outline_length(const Coverage& image) {
  double length = 0.0;
  const auto at = [&](int x, int y) {
    return double(image.values[std::size_t(y) * std::size_t(image.width) + std::size_t(x)]);
  };
  for (int y = 1; y + 1 < image.height; ++y) {
    for (int x = 1; x + 1 < image.width; ++x) {
      length += 0.5 * std::hypot(at(x + 1, y) - at(x - 1, y), at(x, y + 1) - at(x, y - 1));
    }
  }
  return length;
}

Silhouette::Silhouette(std::span<const std::uint8_t> matte, int width, int height)
    : width_(width), height_(height) {
  if (matte.size() != pixels_of(width, height)) {
    throw_input("a matte is of another size than its image.");
  }
  bool inside = false;
  for (std::size_t i = 0; i < matte.size(); ++i) {
    if ((matte[i] >= kHalf) == inside) continue;
    inside = !inside;
    turns_.push_back(static_cast<std::uint32_t>(i));
  }
  const auto w = static_cast<std::size_t>(width);
  outline_ = outline_of(
      [&](int x, int y) { return float(matte[std::size_t(y) * w + std::size_t(x)]) / 255.0F; },
      width, height);
}

std::vector<std::uint8_t> Silhouette::covered() const {
  std::vector<std::uint8_t> covered(pixels_of(width_, height_), 0);
  for (std::size_t k = 0; k < turns_.size(); k += 2) {
    const std::size_t end = k + 1 < turns_.size() ? turns_[k + 1] : covered.size();
    std::fill(covered.begin() + std::ptrdiff_t(turns_[k]), covered.begin() + std::ptrdiff_t(end),
              std::uint8_t{1});
  }
  return covered;
}

Agreement agreement(std::span<const float> mask, const Silhouette& matte) {
  const std::vector<std::uint8_t> covered = matte.covered();
  if (mask.size() != covered.size()) throw_input("a mask and a matte are of different sizes.");
  Agreement result;
  std::size_t both = 0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const bool ours = mask[i] >= 0.5F;
    const bool theirs = covered[i] != 0;
    if (ours && theirs) ++both;
    if (ours && !theirs) ++result.outside;
    if (!ours && theirs) ++result.missing;
  }
  const std::size_t either = both + result.outside + result.missing;
  result.iou =
      either == 0 ? std::numeric_limits<double>::quiet_NaN() : double(both) / double(either);
  const auto w = static_cast<std::size_t>(matte.width());
  const OutlinePoints ours =
      outline_of([&](int x, int y) { return mask[std::size_t(y) * w + std::size_t(x)]; },
                 matte.width(), matte.height());
  const OutlinePoints& theirs = matte.outline_;
  result.contour_px = ours.empty() || theirs.empty()
                          ? std::numeric_limits<double>::quiet_NaN()
                          : 0.5 * (mean_distance(ours, theirs) + mean_distance(theirs, ours));
  return result;
}

}  // namespace matterfit::fit
