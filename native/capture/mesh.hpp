// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::capture {

/// A polygon mesh; with creases, a subdivision cage (Catmull–Clark).
struct Mesh {
  std::vector<Vec3f> vertices;              ///< [m]
  std::vector<std::int32_t> face_sizes;     ///< vertices of each face, ≥ 3
  std::vector<std::int32_t> face_vertices;  ///< concatenated, counter-clockwise from outside
  std::vector<std::int32_t> crease_edges;   ///< (C, 2) vertex pairs; cages only
  std::vector<float> crease_sharpness;      ///< (C,) OpenSubdiv sharpness, 10 is infinite
};

/// Reads .ply (ASCII or binary little/big endian, polygons), .obj (v, f) or .npz (`vertices`
/// (V,3), `face_sizes` (F,), `face_vertices` (ΣF,), optional `crease_edges` (C,2),
/// `crease_sharpness` (C,)). Throws Error(kInput) naming file, offset and reason.
[[nodiscard]] Mesh read_mesh(const std::filesystem::path& path);

/// The formats one by one, in memory; `name` stands in messages.
[[nodiscard]] Mesh parse_mesh_ply(std::span<const std::byte> bytes, const std::string& name);
[[nodiscard]] Mesh parse_mesh_obj(std::span<const std::byte> bytes, const std::string& name);
[[nodiscard]] Mesh parse_mesh_npz(std::span<const std::byte> bytes, const std::string& name);

/// Throws Error(kInput) naming the face or crease if an index, a size or a coordinate is wrong.
void check_mesh(const Mesh& mesh, const std::string& name);

/// Writes vertices and faces as binary little endian PLY (creases are not written).
void write_mesh_ply(const std::filesystem::path& path, const Mesh& mesh);

}  // namespace matterfit::capture
