// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/collider_mesh.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numeric>
#include <random>
#include <thread>

#include "base/error.hpp"
#include "shape/mesh_distance.hpp"
#include "shape/mesh_shapes_for_test.hpp"

namespace matterfit::shape {
namespace {

using namespace test_shapes;

Vec3d random_point(std::mt19937& random, double half) {
  std::uniform_real_distribution<double> unit(-half, half);
  const double x = unit(random);
  const double y = unit(random);
  return {x, y, unit(random)};
}

/// The mesh collider of a box must be the analytic box, wherever it promises to be exact.
void expect_same_as(const Collider& mesh, const Collider& exact, double time, double half) {
  std::mt19937 random(3);
  int within = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3d x = random_point(random, half);
    const SurfacePoint expected = exact.closest(x, time);
    const SurfacePoint found = mesh.closest(x, time);
    if (std::abs(expected.distance) >= mesh.band()) {
      EXPECT_DOUBLE_EQ(found.distance, std::copysign(mesh.band(), expected.distance))
          << x.transpose();
      continue;
    }
    ++within;
    ASSERT_NEAR(found.distance, expected.distance, 1e-7) << x.transpose();
    EXPECT_NEAR((found.velocity - expected.velocity).norm(), 0.0, 1e-5) << x.transpose();
    if (std::abs(expected.distance) > 1e-3 && expected.distance > 0) {
      EXPECT_NEAR((found.normal - expected.normal).norm(), 0.0, 1e-4) << x.transpose();
    }
  }
  EXPECT_GT(within, 50);
}

TEST(MeshCollider, BoxIsTheAnalyticBox) {
  Keyed<Pose> pose;
  pose.times = {0.0, 2.0};
  pose.values = {
      {Vec3d(0.1, 0, 0), Quatd::Identity()},
      {Vec3d(0.2, 0.3, 0.1), Quatd(Eigen::AngleAxisd(2.5, Vec3d(1, 1, 0.5).normalized()))}};
  const PolygonArrays mesh = box(Vec3f(-0.3F, -0.2F, -0.4F), Vec3f(0.3F, 0.2F, 0.4F));
  const auto exact = make_box("exact", Contact{}, Vec3d(0.3F, 0.2F, 0.4F), pose);
  for (const double voxel : {0.1, 0.02}) {
    MeshColliderOptions options;
    options.voxel_size = voxel;
    options.band = 0.09;
    const auto collider = make_mesh_collider("box", Contact{}, mesh, pose, options);
    for (const double time : {-1.0, 0.7, 2.5}) expect_same_as(*collider, *exact, time, 0.8);
  }
}

TEST(MeshCollider, IsCancelledWhileItIsMade) {
  const PolygonArrays mesh = box(Vec3f(-0.3F, -0.2F, -0.4F), Vec3f(0.3F, 0.2F, 0.4F));
  Interrupter interrupter;
  MeshColliderOptions options;
  options.interrupter = &interrupter;
  EXPECT_NE(make_mesh_collider("box", Contact{}, mesh, Keyed<Pose>(Pose{}), options), nullptr);
  interrupter.cancel();
  try {
    (void)make_mesh_collider("box", Contact{}, mesh, Keyed<Pose>(Pose{}), options);
    FAIL() << "it was made in spite of Cancel";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCancelled);
  }
}

TEST(MeshCollider, CancelEndsTheAnalysisOfAMesh) {
  // Each of its steps looks by itself: what comes first would hide that the next does not.
  const PolygonArrays mesh = sphere(Vec3f::Zero(), 1.0F, 100);
  const auto triangles = triangulate("sphere", mesh.vertices, mesh.face_sizes, mesh.face_vertices);
  const std::vector<std::vector<Vec3f>> frames{mesh.vertices};
  Interrupter interrupter;
  const MeshTopology topology = analyse_topology(triangles, frames, &interrupter);
  std::vector<std::int32_t> members(topology.triangles.size());
  std::iota(members.begin(), members.end(), 0);
  interrupter.cancel();
  for (const std::function<void()>& step : std::vector<std::function<void()>>{
           [&] { (void)analyse_topology(triangles, frames, &interrupter); },
           [&] { const TriangleTree tree(topology, members, frames, &interrupter); },
           [&] { const MeshDistance distance(triangles, frames, 0.1, &interrupter); }}) {
    try {
      step();
      ADD_FAILURE() << "it went on";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kCancelled) << error.what();
    }
  }
}

TEST(MeshCollider, SphereBelowTheVoxel) {
  // 200 rings: the facets lie at most r(1 − cos(π/400)) ≈ 1.2e-5 below the sphere.
  const float radius = 0.4F;
  const int rings = 200;
  MeshColliderOptions options;
  options.voxel_size = 0.02;
  const auto collider = make_mesh_collider("ball", Contact{}, sphere(Vec3f::Zero(), radius, rings),
                                           Keyed<Pose>(Pose{}), options);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> offset(-0.07, 0.07);
  const double sagitta = 2 * radius * (1 - std::cos(std::acos(-1.0) / rings / 2));
  for (int i = 0; i < 2000; ++i) {
    const Vec3d direction = random_point(random, 1.0).normalized();
    const double d = offset(random);
    const SurfacePoint point = collider->closest((radius + d) * direction, 0.0);
    ASSERT_NEAR(point.distance, d, sagitta + 1e-6);
    EXPECT_LT(std::abs(point.distance - d), 0.01 * options.voxel_size);
    EXPECT_GT(point.normal.dot(direction), 0.9998);
  }
  EXPECT_DOUBLE_EQ(collider->closest(Vec3d::Zero(), 0).distance, -collider->band());
  EXPECT_DOUBLE_EQ(collider->closest(Vec3d(5, 0, 0), 0).distance, collider->band());
}

TEST(MeshCollider, InvertedBoxIsTurnedAndOverlapsJoin) {
  const PolygonArrays a = inverted(box(Vec3f(-0.5F, -0.5F, -0.5F), Vec3f(0.2F, 0.5F, 0.5F)));
  const PolygonArrays b = box(Vec3f(-0.2F, -0.4F, -0.4F), Vec3f(0.7F, 0.4F, 0.4F));
  MeshColliderOptions options;
  options.voxel_size = 0.05;
  options.band = 0.2;
  const auto collider =
      make_mesh_collider("two", Contact{}, joined(a, b), Keyed<Pose>(Pose{}), options);
  EXPECT_NEAR(collider->closest(Vec3d(-0.6, 0, 0), 0).distance, 0.1, 1e-6);
  EXPECT_NEAR(collider->closest(Vec3d(0.8, 0, 0), 0).distance, 0.1, 1e-6);
  // On the buried side of the first box, well inside the second one.
  EXPECT_LT(collider->closest(Vec3d(0.21, 0, 0), 0).distance, -0.19);
  EXPECT_LT(collider->closest(Vec3d(0.19, 0, 0), 0).distance, -0.19);
}

TEST(MeshCollider, HollowSphereHasACavity) {
  const PolygonArrays mesh =
      joined(sphere(Vec3f::Zero(), 0.5F, 60), inverted(sphere(Vec3f::Zero(), 0.3F, 60)));
  MeshColliderOptions options;
  options.voxel_size = 0.03;
  options.band = 0.05;
  const auto shell = make_mesh_collider("shell", Contact{}, mesh, Keyed<Pose>(Pose{}), options);
  EXPECT_DOUBLE_EQ(shell->closest(Vec3d::Zero(), 0).distance, options.band);
  EXPECT_NEAR(shell->closest(Vec3d(0.28, 0, 0), 0).distance, 0.02, 1e-3);
  EXPECT_LT(shell->closest(Vec3d(0.28, 0, 0), 0).normal.x(), -0.99);
  EXPECT_NEAR(shell->closest(Vec3d(0.32, 0, 0), 0).distance, -0.02, 1e-3);
  EXPECT_DOUBLE_EQ(shell->closest(Vec3d(0.4, 0, 0), 0).distance, -options.band);
  EXPECT_NEAR(shell->closest(Vec3d(0, 0.52, 0), 0).distance, 0.02, 1e-3);
}

TEST(MeshCollider, OpenMeshIsAOneSidedSheet) {
  PolygonArrays mesh;
  mesh.vertices = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.face_sizes = {4};
  mesh.face_vertices = {0, 1, 2, 3};
  MeshColliderOptions options;
  options.voxel_size = 0.05;
  options.band = 0.2;
  const auto sheet = make_mesh_collider("floor", Contact{}, mesh, Keyed<Pose>(Pose{}), options);
  EXPECT_NEAR(sheet->closest(Vec3d(0.3, 0.2, 0.1), 0).distance, 0.1, 1e-12);
  const SurfacePoint below = sheet->closest(Vec3d(0.3, 0.2, -0.17), 0);
  EXPECT_NEAR(below.distance, -0.17, 1e-12);
  EXPECT_EQ(below.normal, Vec3d(0, 0, 1));
  EXPECT_DOUBLE_EQ(sheet->closest(Vec3d(0.3, 0.2, -0.3), 0).distance, options.band);
  EXPECT_NEAR(sheet->closest(Vec3d(1.03, 0, -0.04), 0).distance, 0.05, 1e-9);
}

TEST(MeshCollider, UnweldedTrianglesAreClosed) {
  const PolygonArrays whole = box(Vec3f(-1, -1, -1), Vec3f(1, 1, 1));
  PolygonArrays soup;
  for (const std::int32_t v : whole.face_vertices) {
    soup.face_vertices.push_back(static_cast<std::int32_t>(soup.vertices.size()));
    soup.vertices.push_back(whole.vertices[static_cast<std::size_t>(v)]);
  }
  soup.face_sizes = whole.face_sizes;
  const auto collider = make_mesh_collider("soup", Contact{}, soup, Keyed<Pose>(Pose{}));
  EXPECT_DOUBLE_EQ(collider->closest(Vec3d::Zero(), 0).distance, -collider->band());
  EXPECT_NEAR(collider->closest(Vec3d(1.01, 0.99, 0.2), 0).distance, 0.01, 1e-12);
}

TEST(DeformingCollider, TranslationIsTheRigidOne) {
  const PolygonArrays faces = box(Vec3f(-0.3F, -0.3F, -0.3F), Vec3f(0.3F, 0.3F, 0.3F));
  Keyed<Pose> pose;
  std::vector<std::vector<Vec3f>> frames;
  for (int f = 0; f < 4; ++f) {
    const Vec3f shift(0.25F * static_cast<float>(f), 0.0F, 0.125F * static_cast<float>(f * f));
    frames.push_back(faces.vertices);
    for (Vec3f& p : frames.back()) p += shift;
    pose.times.push_back(0.1 * f);
    pose.values.push_back({shift.cast<double>(), Quatd::Identity()});
  }
  MeshColliderOptions options;
  options.voxel_size = 0.05;
  options.band = 0.11;
  const auto moving =
      make_deforming_collider("moving", Contact{}, faces, frames, pose.times, options);
  const auto exact = make_box("exact", Contact{}, Vec3d::Constant(0.3F), pose);
  for (const double time : {-0.1, 0.0, 0.033, 0.05, 0.17, 0.29, 0.5}) {
    expect_same_as(*moving, *exact, time, 1.2);
  }
}

TEST(DeformingCollider, GrowingSphere) {
  const PolygonArrays small = sphere(Vec3f::Zero(), 0.2F, 60);
  std::vector<std::vector<Vec3f>> frames{small.vertices, small.vertices};
  for (Vec3f& p : frames[1]) p *= 2.0F;
  MeshColliderOptions options;
  options.voxel_size = 0.04;
  const auto growing =
      make_deforming_collider("growing", Contact{}, small, frames, {1.0, 1.5}, options);
  const double time = 1.3;
  const double radius = 0.2 + 0.2 * (time - 1.0) / 0.5;
  std::mt19937 random(11);
  for (int i = 0; i < 200; ++i) {
    const Vec3d direction = random_point(random, 1.0).normalized();
    const SurfacePoint point = growing->closest((radius + 0.01) * direction, time);
    EXPECT_NEAR(point.distance, 0.01, 5e-4);
    EXPECT_NEAR((point.velocity - 0.4 * direction).norm(), 0.0, 2e-2);
  }
}

TEST(DeformingCollider, ThreadsAgree) {
  const PolygonArrays ball = sphere(Vec3f::Zero(), 0.3F, 12);
  std::vector<std::vector<Vec3f>> frames(6, ball.vertices);
  std::vector<double> times;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    times.push_back(0.1 * static_cast<double>(f));
    for (Vec3f& p : frames[f]) p.z() *= 1.0F + 0.1F * static_cast<float>(f);
  }
  const auto run = [&](int threads) {
    const auto collider =
        make_deforming_collider("ball", Contact{}, ball, frames, times, {.voxel_size = 0.04});
    std::vector<double> distances(600);
    std::vector<std::thread> pool;
    for (int t = 0; t < threads; ++t) {
      pool.emplace_back([&, t] {
        for (std::size_t i = static_cast<std::size_t>(t); i < distances.size();
             i += static_cast<std::size_t>(threads)) {
          std::mt19937 random(static_cast<unsigned>(i));
          distances[i] = collider->closest(random_point(random, 0.5), 0.001 * double(i)).distance;
        }
      });
    }
    for (std::thread& thread : pool) thread.join();
    return distances;
  };
  EXPECT_EQ(run(1), run(4));
}

TEST(MeshCollider, RefusesWhatIsNoMesh) {
  PolygonArrays mesh = box(Vec3f(0, 0, 0), Vec3f(1, 1, 1));
  mesh.face_vertices[3] = 99;
  EXPECT_THROW((void)make_mesh_collider("bad", Contact{}, mesh, Keyed<Pose>(Pose{})), Error);
  mesh = box(Vec3f(0, 0, 0), Vec3f(1, 1, 1));
  MeshColliderOptions options;
  options.voxel_size = 1e-6;
  EXPECT_THROW((void)make_mesh_collider("fine", Contact{}, mesh, Keyed<Pose>(Pose{}), options),
               Error);
  EXPECT_THROW((void)make_deforming_collider("short", Contact{}, mesh,
                                             {mesh.vertices, std::vector<Vec3f>(3)}, {0.0, 1.0}),
               Error);
}

}  // namespace
}  // namespace matterfit::shape
