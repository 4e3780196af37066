// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/random_solids.hpp"

#include <gtest/gtest.h>

namespace matterfit::bench {
namespace {

/// A dozen of `make random-solids`, coarser and shorter.
TEST(RandomSolids, RunWithinTheirEnergyAndOutOfTheFloor) {
  ThrowSetting setting;
  setting.particles = 300;
  setting.seconds = 0.6;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const RandomThrow thrown = random_throw(seed, setting);
    const ThrowResult result = run_throw(thrown, 1);
    EXPECT_TRUE(result.ran) << seed << ": " << thrown.words << ": " << result.error;
    EXPECT_TRUE(is_right(thrown, result))
        << seed << ": " << thrown.words << ": " << result.highest << " of " << thrown.height
        << " m high, " << result.penetration / thrown.size << " of its size deep";
  }
}

}  // namespace
}  // namespace matterfit::bench
