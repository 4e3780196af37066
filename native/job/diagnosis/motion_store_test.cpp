// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/motion_store.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "base/file.hpp"
#include "base/folder_for_test.hpp"

namespace matterfit::job {
namespace {

diagnose::Point stored_point(double e) {
  diagnose::Point point;
  point.theta = Eigen::VectorXd::Constant(2, e);
  return point;
}

TEST(MotionStore, WhatIsKeptComesBackToTheLastBit) {
  const Folder folder;
  const MotionStore store(folder.path / "store", "inputs");
  diagnose::Motion motion;
  motion.positions = Eigen::VectorXd::LinSpaced(9, 0.1, 0.7);
  motion.work = 1.0 / 3.0;
  EXPECT_FALSE(store.find(stored_point(1.0)));
  store.keep(stored_point(1.0), motion);
  const auto found = store.find(stored_point(1.0));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->positions, motion.positions);
  EXPECT_EQ(found->work, motion.work);
  EXPECT_FALSE(store.find(stored_point(2.0)));
  EXPECT_FALSE(MotionStore(folder.path / "store", "others").find(stored_point(1.0)));
}

TEST(MotionStore, ADamagedFileIsAsIfItWereNotThere) {
  const Folder folder;
  const MotionStore store(folder.path / "store", "inputs");
  diagnose::Motion motion;
  motion.positions = Eigen::VectorXd::Zero(3);
  store.keep(stored_point(1.0), motion);
  const auto file = std::filesystem::directory_iterator(folder.path / "store")->path();
  const std::vector<std::byte> whole = read_file(file);
  for (const std::size_t length : {std::size_t{0}, std::size_t{32}, whole.size() - 8}) {
    std::filesystem::resize_file(file, length);
    EXPECT_FALSE(store.find(stored_point(1.0))) << length;
    write_file(file, std::string_view(reinterpret_cast<const char*>(whole.data()), whole.size()));
  }
  EXPECT_TRUE(store.find(stored_point(1.0)));
  store.clear();
  EXPECT_FALSE(store.find(stored_point(1.0)));
}

}  // namespace
}  // namespace matterfit::job
