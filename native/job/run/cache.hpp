// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "job/documents/document.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/manifest.hpp"
#include "job/run/folder_lock.hpp"

namespace matterfit::job {

/// What becomes of results that the folder holds.
enum class Restart {
  kNever,         ///< the run goes on from them, and refuses those of other inputs
  kAlways,        ///< they are removed
  kWhereChanged,  ///< those of the same inputs are used, others removed
};

/// A job's output folder while the job runs: locked, its manifest compared with the job's inputs.
class Cache {
 public:
  /// Locks the folder and compares. Throws Error(kInput) with the list of what changed where it
  /// holds results of other inputs and `restart` is kNever. Nothing is removed yet.
  Cache(const Job& job, const Inputs& inputs, Restart restart);
  /// Once the job is known to be sound: removes what the manifest lists, unless the run goes on
  /// from it; what is in `kept` stays.
  void begin(const Job& job, const Inputs& inputs, const std::vector<std::string>& kept = {});

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] Manifest& manifest() { return manifest_; }
  [[nodiscard]] const Manifest& manifest() const { return manifest_; }

  /// What a fit found whose fitted scene these results are: a run of that scene keeps it. Null: no
  /// fit did.
  [[nodiscard]] const Json& fit() const { return fit_; }

  /// Listed and of the listed size on disk.
  [[nodiscard]] bool is_sound(const std::string& path) const;
  void record(const std::string& path, bool is_result = true);
  /// A log or checkpoint: listed, so that it may be removed, but not checked.
  void record_volatile(const std::string& path);
  void remove(const std::string& path) { remove_file(manifest_, folder_, path); }
  /// The hash of the job's recordings; where the folder's comparison is with others its report is
  /// removed, which a run that is cancelled would leave.
  [[nodiscard]] std::string begin_comparison(const Job& job);
  void save() const { write_manifest(folder_, manifest_); }

  /// Frames from the first whose state files are sound; none if they are to be removed.
  [[nodiscard]] std::size_t sound_states() const;

 private:
  std::filesystem::path folder_;
  FolderLock lock_;
  Manifest manifest_;
  Json fit_;
  bool afresh_ = false;
};

}  // namespace matterfit::job
