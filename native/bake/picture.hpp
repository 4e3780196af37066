// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/vec.hpp"
#include "capture/png.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::bake {

/// The rasteriser's image with 8 bits a channel. Colours are blended as they are, in sRGB.
/// Without a background (sRGB, 0 to 1) the mask becomes alpha and is divided out of the colours.
[[nodiscard]] capture::Bitmap picture(const splat::Image& image,
                                      const std::optional<Vec3d>& background);

/// A colour for each particle of a body at rest (sRGB): the body's own of a small palette, lighter
/// and darker in blocks of four particle separations, which show how it moves.
[[nodiscard]] std::vector<Vec3f> block_colours(const Points& rest, double separation,
                                               std::size_t body);

}  // namespace matterfit::bake
