// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "capture/png.hpp"

namespace matterfit::capture {

/// JPEG in colour or grey, baseline or progressive, by libjpeg-turbo. Pixels stand as they are
/// stored: an orientation in the file's EXIF data is not followed, as cameras are calibrated
/// without it. Throws Error(kInput) beginning with `name`, also where data are missing or damaged,
/// which libjpeg itself would make grey.
[[nodiscard]] Bitmap parse_jpeg(std::span<const std::byte> bytes, const std::string& name);

/// Width and height. Throws Error(kInput).
[[nodiscard]] std::array<int, 2> jpeg_size(std::span<const std::byte> bytes,
                                           const std::string& name);

}  // namespace matterfit::capture
