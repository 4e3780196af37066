// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::capture {

/// A polygon mesh; with creases, a subdivision cage (Catmull–Clark).
struct Mesh {
  std::vector<Vec3f> vertices;                ///< [m]
  std::vector<std::int32_t> face_sizes;       ///< vertices of each face, ≥ 3
  std::vector<std::int32_t> face_vertices;    ///< concatenated, counter-clockwise from outside
  std::vector<std::int32_t> crease_edges;     ///< (C, 2) vertex pairs; cages only
  std::vector<float> crease_sharpness;        ///< (C,) OpenSubdiv sharpness, 10 is infinite
};

/// Reads .ply (ASCII or binary little/big endian, polygons), .obj (v, f) or .npz (`vertices`
/// (V,3), `face_sizes` (F,), `face_vertices` (ΣF,), optional `crease_edges` (C,2),
/// `crease_sharpness` (C,)). Throws Error(kInput) naming file, offset and reason.
[[nodiscard]] Mesh read_mesh(const std::filesystem::path& path);

}  // namespace matterfit::capture
