// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/surface_places.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace matterfit::job {
namespace {

constexpr double kApart = 0.1;

/// A lattice over a box whose low corner is the origin, of those points that `inside` takes.
template <class Inside>
mpm::Body lattice(int nx, int ny, int nz, Inside inside) {
  mpm::Body body;
  for (int i = 0; i < nx; ++i) {
    for (int j = 0; j < ny; ++j) {
      for (int k = 0; k < nz; ++k) {
        const Vec3d x = kApart * Vec3d(i + 0.5, j + 0.5, k + 0.5);
        if (!inside(x)) continue;
        body.rest.push_back(x);
        body.volumes.push_back(kApart * kApart * kApart);
      }
    }
  }
  return body;
}

const SurfacePlace& said(const std::vector<SurfacePlace>& places, const std::string& words) {
  const auto found = std::ranges::find(places, words, &SurfacePlace::words);
  EXPECT_NE(found, places.end()) << words;
  return found == places.end() ? places.front() : *found;
}

TEST(SurfacePlaces, OfALongBoxAreItsFacesEdgesAndCorners) {
  const mpm::Body beam = lattice(20, 4, 4, [](const Vec3d&) { return true; });
  const std::vector<SurfacePlace> places = surface_places(beam, kApart);
  ASSERT_EQ(places.size(), 26U);
  const auto near = [&](const char* words, const Vec3d& there) {
    EXPECT_LT((said(places, words).position - there).norm(), 1e-9) << words;
  };
  near("at the end towards +x", {2.0, 0.2, 0.2});
  near("at the end towards -z", {1.0, 0.2, 0.0});
  near("at the edge towards +x and +z", {2.0, 0.2, 0.4});
  near("at the corner towards -x, +y and -z", {0.0, 0.4, 0.0});
}

/// A corner of the box around a ball is not in it.
TEST(SurfacePlaces, OfABallLieOnIt) {
  const Vec3d center(1.0, 1.0, 1.0);
  const mpm::Body ball =
      lattice(20, 20, 20, [&](const Vec3d& x) { return (x - center).norm() < 1.0; });
  for (const SurfacePlace& place : surface_places(ball, kApart)) {
    EXPECT_NEAR((place.position - center).norm(), 1.0, 1.2 * kApart) << place.words;
  }
}

}  // namespace
}  // namespace matterfit::job
