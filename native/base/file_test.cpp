// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <string>

#include "base/error.hpp"

namespace matterfit {
namespace {

namespace fs = std::filesystem;

class FileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("matterfit_file_test_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(FileTest, WritesThroughStreamAndBytesAlike) {
  AtomicFile file(folder_ / "sub" / "a.bin");
  file.write("header--");
  file.stream() << "stream";
  EXPECT_FALSE(fs::exists(folder_ / "sub" / "a.bin"))
      << "the final name appears with commit() only";
  file.commit();
  const auto bytes = read_file(folder_ / "sub" / "a.bin");
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()),
            "header--stream");
}

TEST_F(FileTest, LeavesNothingBehindWithoutCommit) {
  {
    AtomicFile file(folder_ / "a.bin");
    file.write("x");
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(FileTest, FullDiskIsAnErrorNamingThePath) {
  rlimit saved{};
  getrlimit(RLIMIT_FSIZE, &saved);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = saved;
  small.rlim_cur = 1000;
  setrlimit(RLIMIT_FSIZE, &small);
  std::string message;
  try {
    AtomicFile file(folder_ / "big.bin");
    const std::string block(4000, 'x');
    file.stream().write(block.data(), 4000);
    file.commit();
  } catch (const Error& error) {
    message = error.what();
    EXPECT_EQ(error.kind(), ErrorKind::kOutput);
  }
  setrlimit(RLIMIT_FSIZE, &saved);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_NE(message.find("big.bin"), std::string::npos) << message;
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(FileTest, ReadRefusesWhatIsNotThereOrTooLarge) {
  EXPECT_THROW((void)read_file(folder_ / "none"), Error);
  EXPECT_THROW((void)read_file(folder_), Error);
  write_file(folder_ / "a", "12345");
  EXPECT_THROW((void)read_file(folder_ / "a", 4), Error);
  EXPECT_EQ(read_file(folder_ / "a", 5).size(), 5U);
}

}  // namespace
}  // namespace matterfit
