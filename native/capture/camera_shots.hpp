// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "capture/cameras.hpp"

/// Shared by the readers of all formats of cameras; for use inside this room.
namespace matterfit::capture {

/// Images that a file of cameras may have.
inline constexpr std::size_t kMostImages = 1'000'000;

/// Adds an image: its camera becomes that of an equal pose and lens, or a new one. Throws
/// Error(kInput) beginning with `where`, the file and the image: a focal length that is none, a
/// distortion as check_distortion() refuses it, a size that differs within a camera.
void add_shot(CameraSet& set, Shot shot, const splat::Camera& camera, const Distortion& lens,
              const std::string& where);

/// The number at the end of a file's name, before its ending; nothing where there is none.
[[nodiscard]] std::optional<int> last_digits(const std::string& image);

}  // namespace matterfit::capture
