// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace matterfit::capi {
namespace {

namespace fs = std::filesystem;

/// The C program beside this one uses every function of the interface and checks what it gets.
TEST(CInterface, TheTutorialRuns) {
  const fs::path program = fs::read_symlink("/proc/self/exe").parent_path() / "capi_tutorial";
  if (!fs::exists(program)) GTEST_SKIP() << program << " was not built";
  std::string folder = (fs::temp_directory_path() / "matterfit_tutorial_XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const std::string command = "'" + program.string() + "' '" + folder + "' > /dev/null";
  const int status = std::system(command.c_str());
  fs::remove_all(folder);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0) << command;
}

}  // namespace
}  // namespace matterfit::capi
