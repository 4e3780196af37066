// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/excitation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

/// A block of 6 × 6 × 6 tracks that is stretched along x by e^(ε t) and keeps its width.
InteriorTracks stretched(double strain, std::size_t frames) {
  InteriorTracks tracks;
  tracks.spacing = 0.1;
  for (int i = 0; i < 216; ++i)
    tracks.rest.emplace_back(0.1 * (i % 6), 0.1 * (i / 6 % 6), 0.1 * (i / 36));
  for (std::size_t t = 0; t < frames; ++t) {
    tracks.times.push_back(0.1 * double(t));
    const double stretch = std::exp(strain * double(t) / double(frames - 1));
    for (const Vec3d& x : tracks.rest) tracks.positions.emplace_back(stretch * x.x(), x.y(), x.z());
  }
  return tracks;
}

TEST(Excitation, OfAUniformStretch) {
  Arena arena(1);
  const InteriorTracks tracks = stretched(0.3, 11);
  const Points places{{0.2, 0.2, 0.2}, {0.3, 0.2, 0.3}};
  const auto found = excitation(tracks, places, false, arena);
  ASSERT_TRUE(found);
  // |dev ε| = √(2/3) ε, of which 95 % of the frames stay within the second largest.
  EXPECT_NEAR(found->strain, std::sqrt(2.0 / 3.0) * 0.27, 1e-3);
  EXPECT_NEAR(found->expansion, 0.27, 1e-3);
  EXPECT_EQ(found->compression, 0.0);
  // e^.03 − 1 in a tenth of a second.
  EXPECT_NEAR(found->fastest, std::sqrt(2.0 / 3.0) * 0.3045, 1e-3);
}

TEST(Excitation, WithoutTracksAroundAPlaceThereIsNone) {
  Arena arena(1);
  InteriorTracks tracks = stretched(0.3, 3);
  EXPECT_FALSE(excitation(tracks, {{5.0, 5.0, 5.0}}, false, arena));
  tracks.times.resize(1);
  tracks.positions.resize(216);
  EXPECT_THROW((void)excitation(tracks, {{0.2, 0.2, 0.2}}, false, arena), Error);
}

}  // namespace
}  // namespace matterfit::fit
