// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "job/documents/inputs.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {

inline constexpr std::string_view kCacheSchema = "matterfit.cache/1";

/// What a cache folder holds, `manifest.json`: which frames are done and every file we wrote, with
/// size and hash. Written after the files it names, so it never promises what is not there.
/// Nothing is ever deleted that it does not list.
// NOLINTNEXTLINE(bugprone-exception-escape): of the JSON library's moves it cannot tell
struct Manifest {
  struct File {
    std::uint64_t size = 0;
    std::string hash;       ///< empty: listed for removal only, not checked (logs, checkpoints)
    bool is_result = true;  ///< counts for the result hash: no checkpoints, logs or reports
  };

  std::string version;
  std::string input_hash;
  Inputs inputs;
  std::string output_hash;
  std::string compared_hash;  ///< of the recordings (capture_inputs()); empty: none
  std::string task;
  double fps = 24.0;
  Json fps_given;  ///< as in the document
  int first_frame = 0;
  int end_frame = 0;
  int frames_done = 0;   ///< states and caches of the first so many frames are complete
  int frames_baked = 0;  ///< of them, those whose caches are complete
  bool complete = false;
  std::vector<std::string> grids;
  std::vector<std::string> bodies;
  std::map<std::string, File> files;  ///< by path relative to the folder, '/' between
};

[[nodiscard]] std::string format_manifest(const Manifest& manifest);
/// Throws Error(kInput): not JSON, another schema, or a path that leaves the folder.
[[nodiscard]] Manifest parse_manifest(std::string_view text, const std::string& name);

/// Nothing if the folder has none.
[[nodiscard]] std::optional<Manifest> read_manifest(const std::filesystem::path& folder);
void write_manifest(const std::filesystem::path& folder, const Manifest& manifest);

/// Size and hash of `folder/path`, read back from disk, entered into the manifest.
void record_file(Manifest& manifest, const std::filesystem::path& folder, const std::string& path,
                 bool is_result = true);

/// Removes a file that the manifest lists, and its entry. One that it does not list stays.
void remove_file(Manifest& manifest, const std::filesystem::path& folder, const std::string& path);

/// Hash over the names and contents of all result files as the manifest has them.
[[nodiscard]] std::string result_hash(const Manifest& manifest);

/// One thing that is wrong with a file of a cache.
struct FileFault {
  std::string path;
  std::string what;  ///< "is missing", "has 12 of 400 bytes: truncated", "has another content"
};

/// A file name that a manifest may list: relative, in its folder, and not the manifest's own.
[[nodiscard]] bool stays_inside(const std::string& path);

/// What is wrong with a file that the manifest lists; empty: nothing. Reads it whole.
[[nodiscard]] std::string fault_of(const std::filesystem::path& folder, const std::string& path,
                                   const Manifest::File& file);

/// Compares every listed file with what is on disk.
[[nodiscard]] std::vector<FileFault> verify_files(const Manifest& manifest,
                                                  const std::filesystem::path& folder);

}  // namespace matterfit::job
