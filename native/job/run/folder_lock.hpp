// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

namespace matterfit::job {

/// Keeps two jobs from writing into one folder. Held by the process through flock, so a killed job
/// leaves nothing locked.
class FolderLock {
 public:
  /// Creates the folder. Throws Error(kInput) if another job holds it, Error(kOutput) if it cannot
  /// be created or written to.
  explicit FolderLock(const std::filesystem::path& folder);
  /// Removes the folder if it created it and nothing was put into it.
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
  bool created_ = false;
};

}  // namespace matterfit::job
