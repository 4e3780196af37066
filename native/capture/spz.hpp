// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "capture/splats.hpp"

namespace matterfit::capture {

/// SPZ 2 and 3 (Niantic Labs' README of the format): one gzip stream of a header of 16 bytes, then
/// positions (3 × i24, fixed point), opacities (u8), colours (3 × u8, ½ + 0.15 f_dc), scales (3 ×
/// u8, ln s = b/16 − 10), rotations (2: x y z as u8, b/127.5 − 1; 3: the smallest three of x y z w
/// in 10 bits each), harmonics (u8, (b − 128)/128, coefficient-major). Axes are as in the file:
/// x right, y up, z back by the format's convention, unlike most PLY files.
/// Throws Error(kInput) with the byte and reason; for other versions and degree 4 too.
[[nodiscard]] Splats parse_spz(std::span<const std::byte> bytes, const std::string& name);

}  // namespace matterfit::capture
