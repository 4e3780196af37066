// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "job/document.hpp"
#include "job/folder_lock.hpp"
#include "job/inputs.hpp"
#include "job/manifest.hpp"

namespace matterfit::job {

/// A job's output folder while the job runs: locked, its manifest compared with the job's inputs.
class Cache {
 public:
  /// Throws Error(kInput) with the list of what changed where the folder holds results of other
  /// inputs and `restart` is false. With `restart`, or where nothing is done yet, what the manifest
  /// lists is removed.
  Cache(const Job& job, const Inputs& inputs, bool restart);

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] Manifest& manifest() { return manifest_; }
  [[nodiscard]] const Manifest& manifest() const { return manifest_; }

  /// Listed and of the listed size on disk.
  [[nodiscard]] bool is_sound(const std::string& path) const;
  void record(const std::string& path, bool is_result = true);
  /// A log or checkpoint: listed, so that it may be removed, but not checked.
  void record_volatile(const std::string& path);
  void remove(const std::string& path) { remove_file(manifest_, folder_, path); }
  void save() const { write_manifest(folder_, manifest_); }

  /// Frames from the first whose state files are sound.
  [[nodiscard]] std::size_t sound_states() const;

 private:
  void begin_afresh(const Job& job, const Inputs& inputs);

  std::filesystem::path folder_;
  FolderLock lock_;
  Manifest manifest_;
};

}  // namespace matterfit::job
