// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "capture/png.hpp"

namespace matterfit::capture {

/// An image of any format that is read, recognised by its first bytes and not by its name: PNG,
/// JPEG, OpenEXR. Throws Error(kInput) beginning with `name`.
[[nodiscard]] Bitmap parse_image(std::span<const std::byte> bytes, const std::string& name);
[[nodiscard]] Bitmap read_image(const std::filesystem::path& path);

/// Width and height, from the file's head alone. Throws Error(kInput).
[[nodiscard]] std::array<int, 2> image_size(const std::filesystem::path& path);

}  // namespace matterfit::capture
