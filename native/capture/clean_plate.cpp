// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/clean_plate.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "base/error.hpp"
#include "base/vec.hpp"
#include "capture/matte_region.hpp"
#include "capture/srgb.hpp"

namespace matterfit::capture {
namespace {

constexpr std::size_t kLevels = 16;
constexpr std::size_t kFewest = 64;  ///< pixels that tell the noise of a brightness
/// A median of |x| against the standard deviation, and the Laplacian's gain √(Σ w²).
constexpr double kMedian = 0.6744897501960817;
constexpr double kGain = 6.0;
constexpr int kEdge = 2;    ///< width of the band that is mixed [pixels]
constexpr int kInside = 4;  ///< how far inside the body's own colour is looked for

Vec3d light_of(const Bitmap& image, std::size_t at) {
  const auto& linear = linear_of_bytes();
  const std::uint8_t* rgba = image.rgba.data() + 4 * at;
  return {linear[rgba[0]], linear[rgba[1]], linear[rgba[2]]};
}

/// Width of a step of eight bits in light.
double step_of(int value) {
  const auto& linear = linear_of_bytes();
  const auto at = [&](int v) { return double(linear[static_cast<std::size_t>(v)]); };
  return value < 255 ? at(value + 1) - at(value) : at(255) - at(254);
}

/// How far inside a region each pixel lies, in moves of a king; 0 outside, and no more than `most`.
/// Beyond the image it goes on.
std::vector<int> depths_of(const std::vector<std::uint8_t>& region, int width, int height,
                           int most) {
  std::vector<int> depth(region.size());
  for (std::size_t i = 0; i < region.size(); ++i) depth[i] = region[i] != 0 ? most : 0;
  const auto look = [&](int x, int y, int step) {
    int& own = depth[std::size_t(y) * std::size_t(width) + std::size_t(x)];
    for (const auto& [dx, dy] : {std::pair(-step, 0), std::pair(-step, -step), std::pair(0, -step),
                                 std::pair(step, -step)}) {
      const int i = x + dx;
      const int j = y + dy;
      if (i < 0 || j < 0 || i >= width || j >= height) continue;
      own = std::min(own, depth[std::size_t(j) * std::size_t(width) + std::size_t(i)] + 1);
    }
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) look(x, y, 1);
  }
  for (int y = height - 1; y >= 0; --y) {
    for (int x = width - 1; x >= 0; --x) look(x, y, -1);
  }
  return depth;
}

}  // namespace

CleanPlate::CleanPlate(const Bitmap& plate, double threshold)
    : plate_(plate), threshold_(threshold) {
  if (plate.width < 3 || plate.height < 3) {
    throw_input("a clean plate is at least 3 × 3 pixels.");
  }
  const auto& linear = linear_of_bytes();
  const auto w = static_cast<std::size_t>(plate.width);
  const auto h = static_cast<std::size_t>(plate.height);
  for (std::size_t c = 0; c < 3; ++c) {
    const auto light = [&](std::size_t at) { return double(linear[plate.rgba[4 * at + c]]); };
    std::vector<std::pair<float, float>> samples;  // brightness, what the Laplacian leaves
    samples.reserve((w - 2) * (h - 2));
    for (std::size_t y = 1; y + 1 < h; ++y) {
      for (std::size_t x = 1; x + 1 < w; ++x) {
        const std::size_t at = y * w + x;
        const double corners =
            light(at - w - 1) + light(at - w + 1) + light(at + w - 1) + light(at + w + 1);
        const double edges = light(at - w) + light(at - 1) + light(at + 1) + light(at + w);
        const double own = light(at);
        samples.emplace_back(static_cast<float>((corners + edges + own) / 9.0),
                             static_cast<float>(std::abs(corners - 2.0 * edges + 4.0 * own)));
      }
    }
    std::sort(samples.begin(), samples.end());
    const std::size_t bins = std::clamp<std::size_t>(samples.size() / kFewest, 1, kLevels);
    for (std::size_t b = 0; b < bins; ++b) {
      const std::size_t begin = b * samples.size() / bins;
      const std::size_t end = (b + 1) * samples.size() / bins;
      std::vector<float> left;
      left.reserve(end - begin);
      for (std::size_t i = begin; i < end; ++i) left.push_back(samples[i].second);
      const auto middle = left.begin() + std::ptrdiff_t(left.size() / 2);
      std::nth_element(left.begin(), middle, left.end());
      levels_[c].push_back({samples[(begin + end) / 2].first, *middle / (kMedian * kGain)});
    }
    for (int value = 0; value < 256; ++value) {
      deviations_[c][std::size_t(value)] =
          std::max(std::numbers::sqrt2 * noise(c, linear[std::size_t(value)]), step_of(value));
    }
  }
}

double CleanPlate::noise(std::size_t channel, double light) const {
  const std::vector<Level>& levels = levels_[channel];
  const auto above = std::find_if(levels.begin(), levels.end(),
                                  [&](const Level& level) { return level.light >= light; });
  if (above == levels.begin()) return above->deviation;
  const Level& below = *(above - 1);
  if (above == levels.end()) return below.deviation;
  const double s = (light - below.light) / (above->light - below.light);
  return (1.0 - s) * below.deviation + s * above->deviation;
}

std::vector<std::uint8_t> CleanPlate::different(const Bitmap& image) const {
  std::vector<std::uint8_t> result(image.pixels());
  for (std::size_t i = 0; i < result.size(); ++i) {
    const Vec3d difference = light_of(image, i) - light_of(plate_, i);
    double squares = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double share = difference[Eigen::Index(c)] / deviations_[c][plate_.rgba[4 * i + c]];
      squares += share * share;
    }
    result[i] = squares > threshold_ * threshold_ ? 255 : 0;
  }
  return result;
}

BodyMatte CleanPlate::matte(const Bitmap& image) const {
  if (image.width != plate_.width || image.height != plate_.height) {
    throw_input("an image of " + std::to_string(image.width) + " × " +
                std::to_string(image.height) + " pixels has a clean plate of " +
                std::to_string(plate_.width) + " × " + std::to_string(plate_.height) + ".");
  }
  std::vector<std::uint8_t> region = different(image);
  const double kept = keep_largest_region(region, image.width, image.height);
  const std::vector<int> depth = depths_of(region, image.width, image.height, kEdge + kInside);
  std::vector<std::uint8_t> result = region;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const std::size_t at = std::size_t(y) * std::size_t(image.width) + std::size_t(x);
      if (depth[at] < 1 || depth[at] > kEdge) continue;
      int deepest = depth[at];
      int count = 0;
      Vec3d body = Vec3d::Zero();
      for (int j = std::max(0, y - kInside); j <= std::min(image.height - 1, y + kInside); ++j) {
        for (int i = std::max(0, x - kInside); i <= std::min(image.width - 1, x + kInside); ++i) {
          const std::size_t other = std::size_t(j) * std::size_t(image.width) + std::size_t(i);
          if (depth[other] < deepest) continue;
          if (depth[other] > deepest) {
            deepest = depth[other];
            count = 0;
            body.setZero();
          }
          body += light_of(image, other);
          ++count;
        }
      }
      if (deepest == depth[at]) continue;  // the body is no thicker here
      const Vec3d plate = light_of(plate_, at);
      const Vec3d whole = body / count - plate;
      const double share = (light_of(image, at) - plate).dot(whole) / whole.squaredNorm();
      if (!std::isfinite(share)) continue;
      result[at] = static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(share, 0.0, 1.0)));
    }
  }
  return {std::move(result), kept};
}

}  // namespace matterfit::capture
