// SPDX-License-Identifier: GPL-3.0-or-later
// Shared by the tests of this room: a scratch folder and independent readers.
#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/message_for_test.hpp"
#include "capture/specimens_for_test.hpp"

namespace matterfit::bake {

class FolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("matterfit_bake_" + std::string(info->test_suite_name()) + "_" + info->name() + "_" +
               std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

using namespace capture::test_bodies;

inline std::string slurp(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline void spill(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// Standard output of a shell command; `status` its exit status.
inline std::string run(const std::string& command, int& status) {
  std::string text;
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) {
    status = -1;
    return text;
  }
  std::array<char, 4096> buffer{};
  std::size_t count = 0;
  while ((count = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0) {
    text.append(buffer.data(), count);
  }
  status = ::pclose(pipe);
  return text;
}

/// Runs a script under Debian's Python; `modules` are those it needs. Returns what it prints, or
/// the empty string with `skip` set to the reason.
inline std::string run_python(const std::filesystem::path& folder, const std::string& modules,
                              const std::string& script, std::string& skip) {
  int status = 0;
  run("/usr/bin/python3 -c 'import " + modules + "'", status);
  if (status != 0) {
    skip = "/usr/bin/python3 cannot import " + modules;
    return {};
  }
  spill(folder / "reader.py", script);
  std::string text = run("cd '" + folder.string() + "' && /usr/bin/python3 reader.py", status);
  EXPECT_EQ(status, 0) << text;
  return text;
}

/// Writes fail after `bytes` of a file, as on a full disk, while it lives.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    ::getrlimit(RLIMIT_FSIZE, &saved_);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    rlimit small = saved_;
    small.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &saved_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit saved_{};
  void (*handler_)(int) = SIG_DFL;
};

}  // namespace matterfit::bake
