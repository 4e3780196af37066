// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/rehearsal.hpp"

#include <gtest/gtest.h>

#include "job/fit_fixture_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

/// A cube that falls onto a floor and takes shorter substeps there than in the air.
TEST(Rehearsal, KnowsTheSubstepsOfARunThatLands) {
  const Folder folder;
  Json document = thrown_cube();
  Json& scene = document["scene"];
  scene["particle_separation"] = 0.5 * scene["particle_separation"].get<double>();
  document["task"] = "simulate";
  const Job job = job_of(document, folder.path);
  const Json result = run(document, folder.path);
  const auto arena = std::make_shared<Arena>(2);
  const auto rehearsed = rehearse(job, result["particles"].get<std::size_t>(), 600.0,
                                  mpm::SimdTarget::kAuto, arena, Interrupter());
  ASSERT_TRUE(rehearsed);
  const double ratio = rehearsed->substeps / result["substeps"].get<double>();
  EXPECT_GT(ratio, 0.6);
  EXPECT_LT(ratio, 1.7);
  EXPECT_GE(rehearsed->dearer, 1.0);
  // Broken off at once: nothing is known.
  EXPECT_FALSE(rehearse(job, 1000, 0.0, mpm::SimdTarget::kAuto, arena, Interrupter()));
}

TEST(Rehearsal, OfAJobThatCannotRunIsNone) {
  const Folder folder;
  Json document = thrown_cube();
  document["task"] = "simulate";
  document["scene"]["solver"]["dt"] = 1e-12;
  const Job job = job_of(document, folder.path);
  EXPECT_FALSE(
      rehearse(job, 1000, 1.0, mpm::SimdTarget::kAuto, std::make_shared<Arena>(2), Interrupter()));
}

}  // namespace
}  // namespace matterfit::job
