// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/folder_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "base/error.hpp"

namespace matterfit::job {

FolderLock::FolderLock(const std::filesystem::path& folder) : path_(folder / ".lock") {
  std::error_code code;
  created_ = std::filesystem::create_directories(folder, code);
  if (code) {
    throw_output(folder.string() + ": cannot create the folder: " + code.message() +
                 ". Choose an output folder that can be written to.");
  }
  for (;;) {
    descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor_ < 0) {
      throw_output(folder.string() + ": cannot write into the folder: " + std::strerror(errno) +
                   ". Choose an output folder that can be written to.");
    }
    if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
      const int reason = errno;
      ::close(descriptor_);
      if (reason == EWOULDBLOCK) {
        throw_input(folder.string() +
                    ": another job is writing into this folder. Wait for it, "
                    "cancel it, or choose another output folder.");
      }
      // A file system without locks: go on without one.
      descriptor_ = -1;
      return;
    }
    // The one that held it may have removed the file between our open and our lock.
    struct stat ours {};
    struct stat there {};
    if (::fstat(descriptor_, &ours) == 0 && ::stat(path_.c_str(), &there) == 0 &&
        ours.st_ino == there.st_ino) {
      return;
    }
    ::close(descriptor_);
  }
}

FolderLock::~FolderLock() {
  if (descriptor_ < 0) return;
  ::unlink(path_.c_str());
  if (created_) ::rmdir(path_.parent_path().c_str());  // fails, rightly, where it holds anything
  ::close(descriptor_);
}

}  // namespace matterfit::job
