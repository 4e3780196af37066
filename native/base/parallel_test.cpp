// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/parallel.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "base/error.hpp"

namespace matterfit {
namespace {

/// Half the smallest normal number, computed where the compiler cannot.
float denormal() {
  volatile float smallest = std::numeric_limits<float>::min();
  return smallest * 0.5F;
}

class ArenaOf : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Threads, ArenaOf, testing::Values(1, 2, 5));

TEST_P(ArenaOf, VisitsEveryIndexOnce) {
  Arena arena(GetParam());
  for (const std::size_t begin : {std::size_t{0}, std::size_t{3}}) {
    std::vector<std::atomic<int>> visits(1000);
    arena.parallel_for(begin, visits.size(), 7, [&](std::size_t i) { ++visits[i]; });
    for (std::size_t i = 0; i < visits.size(); ++i) EXPECT_EQ(visits[i], i < begin ? 0 : 1) << i;
  }
  arena.parallel_for(5, 5, 1, [](std::size_t) { FAIL(); });
  arena.parallel_for(6, 5, 1, [](std::size_t) { FAIL(); });
}

TEST_P(ArenaOf, CarriesAnErrorOutAndWorksOn) {
  Arena arena(GetParam());
  try {
    arena.parallel_for(0, 500, 1, [](std::size_t i) {
      if (i == 321) throw Error(ErrorKind::kCompute, "at 321");
    });
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCompute);
    EXPECT_STREQ(error.what(), "at 321");
  }
  EXPECT_THROW(arena.execute([] { throw std::runtime_error("inside"); }), std::runtime_error);
  std::atomic<int> count = 0;
  arena.parallel_for(0, 500, 1, [&](std::size_t) { ++count; });
  EXPECT_EQ(count, 500);
}

TEST_P(ArenaOf, FlushesDenormalsOnEveryThreadAndRestoresTheCaller) {
  ASSERT_GT(denormal(), 0.0F);
  Arena arena(GetParam());
  std::vector<float> seen(400, 1.0F);
  arena.parallel_for(0, seen.size(), 1, [&](std::size_t i) { seen[i] = denormal(); });
  for (const float value : seen) EXPECT_EQ(value, 0.0F);
  EXPECT_GT(denormal(), 0.0F);
  EXPECT_THROW(arena.execute([] { throw std::runtime_error("inside"); }), std::runtime_error);
  EXPECT_GT(denormal(), 0.0F);
  arena.execute(
      [&] { arena.parallel_for(0, 10, 1, [&](std::size_t i) { seen[i] = denormal(); }); });
  EXPECT_GT(denormal(), 0.0F);
}

TEST(Arena, RefusesNonsense) {
  EXPECT_THROW(Arena(-1), Error);
  EXPECT_THROW(Arena(1025), Error);
  EXPECT_GE(Arena(0).threads(), 1);
  EXPECT_EQ(Arena(3).threads(), 3);
}

}  // namespace
}  // namespace matterfit
