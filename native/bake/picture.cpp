// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/picture.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace matterfit::bake {
namespace {

constexpr double kBlock = 4.0;  // particle separations
constexpr float kDarker = 0.72F;

std::uint8_t byte_of(double value) {
  return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(value, 0.0, 1.0)));
}

}  // namespace

capture::Bitmap picture(const splat::Image& image, const std::optional<Vec3d>& background) {
  capture::Bitmap bitmap(image.width, image.height);
  bitmap.has_alpha = !background;
  const std::size_t pixels = image.pixels();
  for (std::size_t i = 0; i < pixels; ++i) {
    const double mask = image.mask[i];
    std::uint8_t* rgba = bitmap.rgba.data() + 4 * i;
    for (std::size_t c = 0; c < 3; ++c) {
      const double colour = image.colour[c * pixels + i];
      if (background) {
        rgba[c] = byte_of(colour + (1.0 - mask) * (*background)[static_cast<int>(c)]);
      } else {
        rgba[c] = mask > 0.0 ? byte_of(colour / mask) : std::uint8_t{0};
      }
    }
    rgba[3] = background ? std::uint8_t{255} : byte_of(mask);
  }
  return bitmap;
}

std::vector<Vec3f> block_colours(const Points& rest, double separation, std::size_t body) {
  static const std::array<Vec3f, 6> kPalette = {
      Vec3f(0.90F, 0.55F, 0.25F), Vec3f(0.30F, 0.60F, 0.85F), Vec3f(0.45F, 0.75F, 0.40F),
      Vec3f(0.85F, 0.40F, 0.55F), Vec3f(0.65F, 0.55F, 0.85F), Vec3f(0.85F, 0.80F, 0.40F)};
  const Vec3f& own = kPalette[body % kPalette.size()];
  std::vector<Vec3f> colours;
  colours.reserve(rest.size());
  Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity());
  for (const Vec3d& x : rest) low = low.cwiseMin(x);
  for (const Vec3d& x : rest) {
    const Vec3d block = ((x - low) / (kBlock * separation)).array().floor();
    const bool odd = std::lround(block.sum()) % 2 != 0;
    colours.push_back(odd ? Vec3f(kDarker * own) : own);
  }
  return colours;
}

}  // namespace matterfit::bake
