// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "capture/cameras.hpp"

namespace matterfit::capture {

/// Cameras of a COLMAP model: its cameras and its images, as text (cameras.txt, images.txt) or
/// binary (cameras.bin, images.bin). A pose takes the world to the camera's axes (x right, y down,
/// looking along z), as ours does; the middle of the first pixel lies at (½, ½). Models of lenses:
/// SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, and FULL_OPENCV where k4, k5 and k6 are
/// 0. Images stand in the order of their names. Points are skipped. Format: COLMAP's documentation,
/// "Output Format". Throws Error(kInput) beginning with the file that is wrong, and the line or
/// byte: another model of a lens, by its name; a quaternion that is none; a camera that is not
/// there; what add_shot() refuses.
[[nodiscard]] CameraSet parse_colmap_text(std::string_view cameras, std::string_view images,
                                          const std::string& folder);
[[nodiscard]] CameraSet parse_colmap_binary(std::span<const std::byte> cameras,
                                            std::span<const std::byte> images,
                                            const std::string& folder);

/// The place of a COLMAP model: the folder that is named, its `sparse/0` or `sparse`, or the folder
/// of a file of the model that is named. Nothing where there is none.
struct ColmapPlace {
  std::filesystem::path folder;
  bool binary = false;  ///< taken where both are there and no file of the text is named
};
[[nodiscard]] std::optional<ColmapPlace> find_colmap(const std::filesystem::path& path);

/// The model with its images. They lie in `images` where it is not empty; else in the first folder
/// that holds one of them: the model's own, `images` beside it or up to two folders above. Mattes
/// are NAME.png or NAME with the ending .png, in a folder `masks` beside the images' folder.
/// Further images of one camera are those that differ from its own by the number at the end of
/// their names alone, where none of that sequence is of another camera: it suffices to register one
/// image of each camera. `notes` of the set says how many there are. A folder of images that was
/// not found leaves `folder` empty.
[[nodiscard]] CameraSet read_colmap(const ColmapPlace& place, const std::filesystem::path& images);

}  // namespace matterfit::capture
