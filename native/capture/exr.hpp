// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "capture/png.hpp"

namespace matterfit::capture {

/// OpenEXR of one part, scan lines or tiles, with the channels R, G, B or Y, and A where there is
/// alpha. Its display window is the image; what the data window leaves of it is black, with alpha
/// transparent. Light (Rec. 709, as sRGB has it) becomes what displays show (capture/srgb.hpp), cut
/// off above 1; colours, into which OpenEXR multiplies alpha, are divided by it. Throws
/// Error(kInput) beginning with `name`.
[[nodiscard]] Bitmap parse_exr(std::span<const std::byte> bytes, const std::string& name);

/// Width and height of the display window, from the head alone. Throws Error(kInput).
[[nodiscard]] std::array<int, 2> exr_size(std::span<const std::byte> bytes,
                                          const std::string& name);

}  // namespace matterfit::capture
