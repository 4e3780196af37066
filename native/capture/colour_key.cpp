// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/colour_key.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/error.hpp"
#include "capture/matte_region.hpp"

namespace matterfit::capture {
namespace {

constexpr double kSmallestChroma = 0.02;
constexpr int kMixed = 1;   ///< width of the band that is mixed with what is behind [pixels]
constexpr int kBehind = 2;  ///< width of what is looked at behind it
constexpr double kMostAround = 0.9;

Vec3d chroma(const Vec3d& colour) { return colour.array() - colour.mean(); }

/// How much of the key's chroma the pixels around the body have: those of a band and two beside it.
double share_around(const std::vector<double>& share, const std::vector<int>& distance) {
  std::vector<double> around;
  for (std::size_t i = 0; i < share.size(); ++i) {
    if (distance[i] > kMixed && distance[i] <= kMixed + kBehind) around.push_back(share[i]);
  }
  if (around.empty()) return 0.0;
  const auto middle = around.begin() + std::ptrdiff_t(around.size() / 2);
  std::ranges::nth_element(around, middle);
  return std::clamp(*middle, 0.0, kMostAround);
}

}  // namespace

KeyedMatte keyed_matte(const Bitmap& image, const ColourKey& key) {
  const Vec3d direction = chroma(key.colour);
  const double size = direction.norm();
  if (!(size > kSmallestChroma)) {
    throw_input("the key of a matte is grey: a body is told from a background by a colour.");
  }
  const double rise = key.range[1] - key.range[0];
  if (!(rise > 0.0)) throw_input("the range of a matte's key does not rise.");
  const auto alpha = [&](double share) {
    const double a = std::clamp((share - key.range[0]) / rise, 0.0, 1.0);
    return static_cast<std::uint8_t>(std::lround(255.0 * a));
  };
  std::vector<double> share(image.pixels(), 0.0);
  KeyedMatte result{std::vector<std::uint8_t>(image.pixels(), 0)};
  for (std::size_t i = 0; i < share.size(); ++i) {
    const std::uint8_t* rgba = image.rgba.data() + 4 * i;
    const Vec3d colour = Vec3d(rgba[0], rgba[1], rgba[2]) / 255.0;
    const Vec3d own = chroma(colour);
    const double along = own.dot(direction) / size;
    if ((own - along / size * direction).norm() > along) continue;
    share[i] = along / size;
    result.alpha[i] = alpha(share[i] / std::max(1.0, colour.mean() / key.colour.mean()));
  }
  result.kept = keep_largest_region(result.alpha, image.width, image.height);
  const std::vector<int> distance =
      distances_from(result.alpha, image.width, image.height, kMixed + kBehind);
  const double around = share_around(share, distance);
  for (std::size_t i = 0; i < share.size(); ++i) {
    if (distance[i] == 0) result.alpha[i] = std::max(result.alpha[i], alpha(share[i]));
    if (distance[i] > 0 && distance[i] <= kMixed) {
      result.alpha[i] = alpha((share[i] - around) / (1.0 - around));
    }
  }
  return result;
}

}  // namespace matterfit::capture
