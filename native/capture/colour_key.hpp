// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/vec.hpp"
#include "capture/matte_region.hpp"
#include "capture/png.hpp"

namespace matterfit::capture {

/// A matte of a body by its colour, for images that have none. A colour's chroma is its difference
/// from its own mean; `s` is how much of the key's chroma a pixel has (1: all of it; a pixel that
/// the body covers by a third, before grey, has 1/3). Alpha rises from 0 at range[0] to 1 at
/// range[1]; a pixel whose chroma points elsewhere than the key's, by more than 45°, has none. What
/// is brighter than the key has to have as much more chroma: a bright wall with a tint is not a
/// dark body. Along the body's edge, a pixel on each side, the chroma of what is around it there
/// counts as none.
struct ColourKey {
  Vec3d colour = Vec3d::Zero();             ///< sRGB, 0 to 1; not grey
  std::array<double, 2> range{0.25, 0.75};  ///< of s
};

/// The matte of an image. Regions are of pixels above ½ that share an edge; the largest is the
/// body, and pixels beside it are its edge. Throws Error(kInput) for a grey key or a range that
/// does not rise.
[[nodiscard]] BodyMatte keyed_matte(const Bitmap& image, const ColourKey& key);

}  // namespace matterfit::capture
