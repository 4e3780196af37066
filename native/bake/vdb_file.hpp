// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <openvdb/openvdb.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace matterfit::bake {

enum class VdbCompression {
  kBlosc,  ///< what Blender and Houdini write; read by every official Blender and by Debian's
  kZip,    ///< smaller and slower; read by every OpenVDB
  kNone,
};

/// Where the 36 characters of the file's UUID stand.
inline constexpr std::size_t kVdbUuidOffset = 21;
inline constexpr std::size_t kVdbUuidSize = 36;

/// Metadata "creator" of our files begins with this.
inline constexpr const char* kVdbCreator = "Matterfit";

/// Writes the grids so that equal grids give equal bytes: OpenVDB's random UUID is replaced by one
/// made from the hash of all other bytes, so that the UUID says whether the file is whole. With
/// grid offsets, so that readers load single grids and headers only. The bytes are assembled in
/// memory (OpenVDB's own File reports success on a full disk) and go through AtomicFile. Returns
/// the size. Throws Error(kOutput).
std::uint64_t write_vdb(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids,
                        VdbCompression compression);

/// The UUID that belongs to the bytes of a VDB file (those at the UUID's place do not count).
[[nodiscard]] std::string content_uuid(std::span<const std::byte> file);

/// openvdb::initialize(), once.
void initialize_openvdb();

}  // namespace matterfit::bake
