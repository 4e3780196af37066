// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_group.hpp"

#include <gtest/gtest.h>

#include <random>

#include "mpm/updated_contact.hpp"
#include "mpm/updated_rollout_for_test.hpp"
namespace matterfit::mpm {
namespace {

/// Two blocks of water that splash on the ground, spin and meet.
Scene splash() {
  Scene scene;
  scene.end_frame = 4;
  scene.dx = 0.05;
  const double h = 0.025;
  for (int n = 0; n < 2; ++n) {
    Body body;
    body.name = n == 0 ? "one" : "two";
    body.material.law = material::Law::kNewtonian;
    body.material.viscosity = 5.0;
    body.material.bulk_modulus = 5e4;
    body.formulation = Formulation::kUpdated;
    body.velocity = Vec3d(0.5, 0.2, -2.0);
    body.spin = Vec3d(3, 1, -2);
    std::mt19937 random(static_cast<unsigned>(3 + n));
    const auto jitter = [&] { return 0.4 * static_cast<double>(random()) / 4294967295.0 - 0.2; };
    for (int i = 0; i < 8; ++i)
      for (int j = 0; j < 8; ++j)
        for (int k = 0; k < 8; ++k) {
          body.rest.push_back(
              h * Vec3d(i + 0.5 + jitter(), j + 0.5 + jitter(), k + 1.5 + jitter()) +
              Vec3d(0.22 * n, 0, 0));
          body.volumes.push_back(h * h * h);
        }
    scene.bodies.push_back(body);
  }
  shape::Contact contact;
  contact.mu = 0.3;
  scene.colliders.push_back(
      shape::make_plane("ground", contact, Vec3d(0, 0, 0.01), Vec3d(0.05, 0, 1)));
  scene.colliders.push_back(shape::make_sphere(
      "ball", contact, 0.1,
      shape::Keyed<shape::Pose>(shape::Pose{Vec3d(0.1, 0.1, -0.04), Quatd::Identity()})));
  return scene;
}

// They were carried along until det F < 0; the logarithm of that, times no volume, is not 0.
TEST(UpdatedGroup, PlacesWhereNobodyIsKeepTheirShape) {
  using Chunk = UpdatedChunk<float>;
  const Scene scene = splash();
  Arena arena(1);
  UpdatedGroup<float> group(scene, {0, 1}, kernels<float>(SimdTarget::kAuto),
                            std::size_t{1} << 30U);
  UpdatedRecord<float> record;
  (void)group.begin_frame(0.0);
  for (int n = 0; n < 20; ++n) {
    (void)group.step(arena, n * 1e-3, 1e-3, Vec3d(0, 0, -9.81), &record);
  }
  int empty = 0;
  for (const KeptChunk<float>& chunk : record.chunks) {
    for (std::size_t l = 0; l < kLanes; ++l) {
      if (chunk.a[Chunk::kVolume][l] > 0.0F) continue;
      ++empty;
      for (std::size_t i = 0; i < 9; ++i) EXPECT_EQ(chunk.a[Chunk::kH + i][l], 0.0F);
    }
  }
  EXPECT_GT(empty, 100);
}

TEST(UpdatedGroup, ARecordedSubstepIsTheSame) {
  const Scene scene = splash();
  Arena arena(1);
  const std::size_t limit = std::size_t{1} << 30U;
  UpdatedGroup<float> plain(scene, {0, 1}, kernels<float>(SimdTarget::kAuto), limit);
  UpdatedGroup<float> recorded(scene, {0, 1}, kernels<float>(SimdTarget::kAuto), limit);
  UpdatedRecord<float> record;
  (void)plain.begin_frame(0.0);
  (void)recorded.begin_frame(0.0);
  for (int n = 0; n < 20; ++n) {
    (void)plain.step(arena, n * 1e-3, 1e-3, Vec3d(0, 0, -9.81));
    (void)recorded.step(arena, n * 1e-3, 1e-3, Vec3d(0, 0, -9.81), &record);
  }
  ByteWriter a;
  ByteWriter b;
  plain.save(a);
  recorded.save(b);
  EXPECT_EQ(a.take(), b.take());
  EXPECT_GT(count_acts<UpdatedTouch<float>>(record), 0U);
}

}  // namespace
}  // namespace matterfit::mpm
