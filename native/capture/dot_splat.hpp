// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "capture/splats.hpp"

namespace matterfit::capture {

/// `.splat`, 32 bytes a Gaussian, little-endian, without a header: position 3 × f32; scale 3 × f32,
/// linear; red, green, blue, opacity as u8, the colour already ½ + 0.28209479 f_dc and the opacity
/// already through the sigmoid; rotation 4 × u8, (b − 128)/128, w first. No harmonics above degree
/// 0. Axes are the trainer's, mostly y down. Scales of 0, which flat files have, become 1e-9 m.
/// Throws Error(kInput) naming row and reason.
[[nodiscard]] Splats parse_dot_splat(std::span<const std::byte> bytes, const std::string& name);

/// Colours and opacities are rounded to 1/255 and cut off at 0 and 1; harmonics above degree 0 are
/// lost. Throws Error(kOutput).
void write_dot_splat(const std::filesystem::path& path, const Splats& splats);

}  // namespace matterfit::capture
