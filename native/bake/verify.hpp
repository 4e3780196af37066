// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bake/guarded_read.hpp"

namespace matterfit::bake {

/// What a manifest keeps of a file.
struct FileRecord {
  std::string path;  ///< relative to the manifest's folder, '/' between parts
  std::uint64_t size = 0;
  std::string hash;  ///< XXH3, 128 bits, 32 hexadecimal digits
};

/// Reads the file once. Throws Error(kInput) if it is missing or cannot be read.
[[nodiscard]] FileRecord record_file(const std::filesystem::path& folder,
                                     const std::filesystem::path& relative);

// What follows returns nothing if the file is whole, else what is wrong with it, beginning with its
// path: «volume/dough_0007.vdb: truncated: 4096 bytes of 20311. Bake frame 7 again.» never throws
// for a bad file.

/// Size and hash against the record: enough for every file our manifest lists, of any kind.
[[nodiscard]] std::optional<std::string> verify_file(const std::filesystem::path& folder,
                                                     const FileRecord& record);

/// A VDB. Those of ours carry the hash of their bytes as UUID and are checked without parsing;
/// every other one is read by OpenVDB, all grids, in a guarded child. `grids`: names that must be
/// there.
[[nodiscard]] std::optional<std::string> verify_vdb(const std::filesystem::path& path,
                                                    const std::vector<std::string>& grids = {},
                                                    const GuardLimits& limits = {});

/// A PC2 of so many points and samples; the size must be exactly what the header says.
[[nodiscard]] std::optional<std::string> verify_pc2(const std::filesystem::path& path,
                                                    std::size_t points, std::size_t frames);

/// An EXR that OpenEXR reads to its last pixel, in a guarded child. `points` 0: any size.
[[nodiscard]] std::optional<std::string> verify_exr(const std::filesystem::path& path,
                                                    std::size_t points = 0,
                                                    const GuardLimits& limits = {});

/// A splat PLY that our reader takes. `count` 0: any number.
[[nodiscard]] std::optional<std::string> verify_splat_ply(const std::filesystem::path& path,
                                                          std::size_t count = 0);

}  // namespace matterfit::bake
