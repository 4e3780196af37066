// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/colour_key.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "capture/matte_region.hpp"

namespace matterfit::capture {
namespace {

constexpr double kSmallestChroma = 0.02;

Vec3d chroma(const Vec3d& colour) { return colour.array() - colour.mean(); }

}  // namespace

std::vector<std::uint8_t> keyed_matte(const Bitmap& image, const ColourKey& key) {
  const Vec3d direction = chroma(key.colour);
  const double size = direction.norm();
  if (!(size > kSmallestChroma)) {
    throw_input("the key of a matte is grey: a body is told from a background by a colour.");
  }
  const double rise = key.range[1] - key.range[0];
  if (!(rise > 0.0)) throw_input("the range of a matte's key does not rise.");
  std::vector<std::uint8_t> matte(image.pixels());
  for (std::size_t i = 0; i < matte.size(); ++i) {
    const std::uint8_t* rgba = image.rgba.data() + 4 * i;
    const Vec3d own = chroma(Vec3d(rgba[0], rgba[1], rgba[2]) / 255.0);
    const double along = own.dot(direction) / size;
    const double across = (own - along / size * direction).norm();
    const double alpha = (along / size - key.range[0]) / rise;
    if (across > along) continue;
    matte[i] = static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(alpha, 0.0, 1.0)));
  }
  keep_largest_region(matte, image.width, image.height);
  return matte;
}

}  // namespace matterfit::capture
