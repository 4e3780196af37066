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
/// How far from a pixel of the edge the background behind it is looked at [pixels].
constexpr int kReachBehind = 3;
constexpr double kMostAround = 0.9;

enum class Part : std::uint8_t { kBehind, kEdge, kBody };

Vec3d chroma(const Vec3d& colour) { return colour.array() - colour.mean(); }

/// The middle of how much of the key's chroma the pixels around a place have that are neither of
/// the body nor of its edge; 0 without any.
double share_around(const std::vector<double>& share, const std::vector<Part>& part, int width,
                    int height, std::size_t place) {
  const int x = int(place % std::size_t(width));
  const int y = int(place / std::size_t(width));
  std::vector<double> around;
  for (int j = std::max(0, y - kReachBehind); j <= std::min(height - 1, y + kReachBehind); ++j) {
    for (int i = std::max(0, x - kReachBehind); i <= std::min(width - 1, x + kReachBehind); ++i) {
      const std::size_t at = std::size_t(j) * std::size_t(width) + std::size_t(i);
      if (part[at] == Part::kBehind) around.push_back(share[at]);
    }
  }
  if (around.empty()) return 0.0;
  const auto middle = around.begin() + std::ptrdiff_t(around.size() / 2);
  std::ranges::nth_element(around, middle);
  return std::clamp(*middle, 0.0, kMostAround);
}

/// The parts of an image by its body, `matte` above ½: the edge is a pixel wide on either side.
std::vector<Part> parts_of(const std::vector<std::uint8_t>& matte, int width, int height) {
  const auto is_body = [&](std::size_t at) { return matte[at] >= kHalfCovered; };
  std::vector<Part> parts(matte.size());
  for (std::size_t at = 0; at < parts.size(); ++at) {
    parts[at] = is_body(at) ? Part::kBody : Part::kBehind;
    for_neighbours(at, width, height, [&](std::size_t next) {
      if (is_body(next) != is_body(at)) parts[at] = Part::kEdge;
    });
  }
  return parts;
}

}  // namespace

BodyMatte keyed_matte(const Bitmap& image, const ColourKey& key) {
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
  BodyMatte result{std::vector<std::uint8_t>(image.pixels(), 0)};
  for (std::size_t i = 0; i < share.size(); ++i) {
    const std::uint8_t* rgba = image.rgba.data() + 4 * i;
    const Vec3d colour = Vec3d(rgba[0], rgba[1], rgba[2]) / 255.0;
    const Vec3d own = chroma(colour);
    const double along = own.dot(direction) / size;
    if ((own - along / size * direction).norm() > along) continue;
    share[i] = along / size;
    result.alpha[i] = alpha(share[i] / std::max(1.0, colour.mean() / key.colour.mean()));
  }
  const std::vector<std::uint8_t> all = result.alpha;
  result.kept = keep_largest_region(result.alpha, image.width, image.height);
  const std::vector<Part> part = parts_of(result.alpha, image.width, image.height);
  for (std::size_t i = 0; i < share.size(); ++i) {
    const bool other = all[i] >= kHalfCovered && result.alpha[i] < kHalfCovered;  // region
    if (other || part[i] == Part::kBehind) {
      result.alpha[i] = 0;
    } else if (part[i] == Part::kBody) {
      result.alpha[i] = std::max(result.alpha[i], alpha(share[i]));
    } else {
      const double around = share_around(share, part, image.width, image.height, i);
      result.alpha[i] = alpha((share[i] - around) / (1.0 - around));
    }
  }
  return result;
}

}  // namespace matterfit::capture
