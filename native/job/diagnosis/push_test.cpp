// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/push.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "job/diagnosis/encounters.hpp"
#include "job/diagnosis/flight_for_test.hpp"
#include "job/diagnosis/hidden_collider.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/run/build_scene.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {
namespace {

using Eigen::Index;
using namespace fit_test;

constexpr Index kPushedFrames = 30;
constexpr double kPushedInterval = 1.0 / 60.0;
constexpr double kPushBegins = 0.175;  // [s], in the middle between frames
constexpr double kPushEnds = 0.258;
const Vec3d kPush(0.0, 20.0, 0.0);  // [m/s²]

/// A cube that flies along x, pushed for a while.
diagnose::Capture pushed_flight(const Vec3d& push, double begin, double end) {
  return flight_of_a_cube(kPushedFrames, kPushedInterval, [&](Index, double t) -> Vec3d {
    const double under = std::clamp(t - begin, 0.0, end - begin);
    const double after = std::max(0.0, t - end);
    return Vec3d(3.0 * t, 0.0, -4.905 * t * t) +
           (0.5 * under * under + (end - begin) * after) * push;
  });
}

std::vector<Encounter> encounters_of(const diagnose::Capture& seen) {
  const diagnose::Capture simulated = pushed_flight(Vec3d::Zero(), 1.0, 2.0);
  return encounters({seen}, simulated.positions, {0.0, 0.0, -9.81});
}

TEST(Encounters, APushThatLastsIsOne) {
  const auto found = encounters_of(pushed_flight(kPush, kPushBegins, kPushEnds));
  ASSERT_FALSE(found.empty());
  const Encounter& push = found.back();
  EXPECT_NEAR((push.normal - Vec3d(0.0, 1.0, 0.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR(push.time, kPushBegins, 0.25 * kPushedInterval);
  EXPECT_NEAR(push.lasts, kPushEnds - kPushBegins, 0.5 * kPushedInterval);
  EXPECT_NEAR(push.point.x(), 0.1 + 3.0 * 0.5 * (kPushBegins + kPushEnds), 0.06);
  EXPECT_NEAR(push.reach, 0.31, 0.03);  // falling and pushed beside its way along x
  // One that is over at once is what a body ran into, a steady one no encounter.
  for (const Encounter& met : encounters_of(pushed_flight(20.0 * kPush, 0.176, 0.178))) {
    EXPECT_EQ(met.lasts, 0.0);
  }
  EXPECT_TRUE(encounters_of(pushed_flight(kPush, 0.0, 2.0)).empty());
}

/// A cube in free flight of the fixtures' size.
Json flying_cube() {
  Json document = thrown_cube();
  Json& scene = document["scene"];
  scene["frames"] = {0, 8};
  scene["particle_separation"] = 0.1;
  scene.erase("colliders");
  return document;
}

Encounter gust() {
  Encounter met;
  met.point = Vec3d(0.3, 0.2, 0.2);
  met.time = 0.05;
  met.lasts = 0.12;
  met.reach = 0.5;
  return met;
}

std::vector<Vec3d> flown(mpm::Scene scene) {
  const int end = scene.end_frame;
  scene.substeps.assign(std::size_t(end - scene.first_frame), 60);
  mpm::Simulation simulation(std::move(scene), std::make_shared<Arena>(1));
  while (simulation.frame() + 1 < end) (void)simulation.advance(Interrupter{});
  return simulation.observe(false).bodies.front().positions;
}

mpm::Scene flying_scene(const Json& document) {
  Arena arena(1);
  return build_scene(job_of(document, {}), arena, Interrupter{}).scene;
}

TEST(Push, IsWrittenAsItActsAndNoneChangesNothing) {
  const Json document = flying_cube();
  const mpm::Scene scene = flying_scene(document);
  const std::optional<Cause> cause = push({gust()}, scene);
  ASSERT_TRUE(cause);
  ASSERT_EQ(cause->row.numbers.size(), 3U);
  ASSERT_EQ(cause->row.variants.size(), 3U);
  const std::vector<Vec3d> plain = flown(scene);
  for (int variant = 0; variant < 3; ++variant) {
    mpm::Scene there = scene;
    cause->apply(std::vector{0.0, 0.0, 0.0}, variant, there);
    EXPECT_EQ(flown(there), plain) << variant;  // to the last bit
    const std::vector<double> values{0.0, 5.0, 0.0};
    there = scene;
    cause->apply(values, variant, there);
    const std::vector<Vec3d> moved = flown(there);
    EXPECT_GT((moved[0] - plain[0]).y(), 0.01) << variant;
    Json extended = document;
    cause->write(values, variant, extended["scene"]);
    const std::vector<Vec3d> written = flown(flying_scene(extended));
    ASSERT_EQ(written.size(), moved.size());
    for (std::size_t i = 0; i < moved.size(); ++i) {
      EXPECT_LT((written[i] - moved[i]).norm(), 1e-6) << variant;
    }
  }
  // While it lasts it gives its acceleration times its time, everywhere.
  mpm::Scene there = scene;
  cause->apply(std::vector{0.0, 5.0, 0.0}, 0, there);
  const double end = 7.0 / 24.0;
  const double way = 5.0 * 0.12 * (end - 0.05 - 0.06);
  EXPECT_NEAR((flown(there)[0] - plain[0]).y(), way, 0.02 * way);
}

TEST(Push, NeedsAnEncounterThatLasts) {
  const mpm::Scene scene = flying_scene(flying_cube());
  Encounter met = gust();
  met.lasts = 0.0;
  EXPECT_FALSE(push({met}, scene));
  EXPECT_TRUE(hidden_collider({met}, scene));
  EXPECT_FALSE(hidden_collider({gust()}, scene));
}

}  // namespace
}  // namespace matterfit::job
