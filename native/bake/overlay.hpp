// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "capture/png.hpp"

namespace matterfit::bake {

/// A drawn mask over a recorded one, to be laid over the photograph: orange where only the
/// simulation is (outside), blue where only the recording is (missing), a breath of white where
/// both are, else transparent; `text` (digits, a point, a minus) in the lower left corner. `mask`
/// 0 to 1 and cut at ½, `covered` 0 or 1, both (height, width), row 0 on top. Throws Error(kInput)
/// where their sizes differ.
[[nodiscard]] capture::Bitmap overlay(std::span<const float> mask,
                                      std::span<const std::uint8_t> covered, int width, int height,
                                      const std::string& text);

}  // namespace matterfit::bake
