// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/subdivision.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "bake/test_support.hpp"
#include "capture/limit_surface.hpp"

namespace matterfit::bake {
namespace {

/// A box of n × n quads a side, as a subdivision cage.
capture::Mesh box_cage(int n, double half) {
  capture::Mesh cage;
  const auto vertex = [&](const Vec3d& x) {
    const Vec3f p = x.cast<float>();
    for (std::size_t i = 0; i < cage.vertices.size(); ++i) {
      if ((cage.vertices[i] - p).norm() < 1e-5F) return static_cast<std::int32_t>(i);
    }
    cage.vertices.push_back(p);
    return static_cast<std::int32_t>(cage.vertices.size() - 1);
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto at = [&](int a, int b) {
            Vec3d x;
            x[axis] = side * half;
            x[(axis + 1) % 3] = half * (2.0 * a / n - 1.0);
            x[(axis + 2) % 3] = half * (2.0 * b / n - 1.0);
            return vertex(x);
          };
          std::array<std::int32_t, 4> quad{at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
          if (side < 0.0) std::reverse(quad.begin(), quad.end());
          cage.face_sizes.push_back(4);
          cage.face_vertices.insert(cage.face_vertices.end(), quad.begin(), quad.end());
        }
  return cage;
}

std::vector<Vec3d> doubles(const std::vector<Vec3f>& points) {
  std::vector<Vec3d> result;
  for (const Vec3f& p : points) result.push_back(p.cast<double>());
  return result;
}

// Our stencils against the refinement of the capture room: the limit point of every cage vertex is
// a vertex of the refined limit mesh.
TEST(CageBinding, LimitPointsLieOnTheLimitSurface) {
  capture::Mesh cage = box_cage(2, 0.5);
  cage.crease_edges = {cage.face_vertices[0], cage.face_vertices[1]};
  cage.crease_sharpness = {10.0F};
  // A triangle and a pentagon too.
  const auto apex = static_cast<std::int32_t>(cage.vertices.size());
  cage.vertices.emplace_back(1.0F, 1.0F, 1.0F);
  cage.vertices.emplace_back(1.0F, 1.2F, 1.0F);
  cage.vertices.emplace_back(1.2F, 1.2F, 1.3F);
  cage.vertices.emplace_back(1.3F, 1.0F, 1.1F);
  cage.vertices.emplace_back(1.1F, 0.8F, 1.2F);
  cage.face_sizes.push_back(5);
  for (const int k : {0, 1, 2, 3, 4}) cage.face_vertices.push_back(apex + k);
  cage.vertices.emplace_back(1.1F, 1.4F, 1.6F);
  cage.face_sizes.push_back(3);
  for (const int k : {1, 5, 2}) cage.face_vertices.push_back(apex + k);
  Arena arena(1);
  const Specimen body = cube(0.1, 0.5);
  const CageBinding binding(cage, body.rest, 0.1, {}, arena);
  const auto limit = binding.limit_positions(doubles(cage.vertices));
  capture::LimitOptions options;
  options.level = 3;
  const capture::Mesh refined = capture::limit_mesh(cage, options);
  for (std::size_t v = 0; v < limit.size(); ++v) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Vec3f& p : refined.vertices) {
      nearest = std::min(nearest, (p.cast<double>() - limit[v]).norm());
    }
    EXPECT_LT(nearest, 1e-4) << v;  // end caps of irregular border faces are approximations
  }
}

// The cube's limit matrix is singular; affine motion must come out exactly all the same.
TEST(CageBinding, AffineMotionMovesTheCageExactly) {
  Arena arena(1);
  Specimen body = cube(0.1, 0.5);
  Mat3d a;
  a << 1.2, 0.3, 0.0, -0.4, 0.9, 0.0, 0.1, 0.0, 0.7;
  const Vec3d b(1.0, 2.0, 3.0);
  body.move(a, b);
  for (const int n : {1, 4}) {
    const capture::Mesh cage = box_cage(n, 0.5);
    const CageBinding binding(cage, body.rest, 0.1, {}, arena);
    const auto moved = binding.cage_positions(body.view(), arena);
    ASSERT_EQ(moved.size(), cage.vertices.size());
    for (std::size_t v = 0; v < moved.size(); ++v) {
      EXPECT_LT((moved[v] - (a * cage.vertices[v].cast<double>() + b)).norm(), 1e-5);
    }
  }
}

// Under a wavy motion the limit surface goes where the particles do: nearer than when the cage's
// own vertices are bound.
TEST(CageBinding, TheLimitSurfaceFollowsTheParticles) {
  Arena arena(2);
  const double h = 0.05;
  Specimen body = cube(h, 0.5);
  const auto wave = [](const Vec3d& x) {
    return Vec3d(x[0], x[1], x[2] + 0.08 * std::sin(7.0 * x[0]) * std::cos(5.0 * x[1]));
  };
  for (std::size_t i = 0; i < body.rest.size(); ++i) {
    const Vec3d& x = body.rest[i];
    body.positions[i] = wave(x).cast<float>();
    body.deformation[i](2, 0) =
        static_cast<float>(0.56 * std::cos(7.0 * x[0]) * std::cos(5.0 * x[1]));
    body.deformation[i](2, 1) =
        static_cast<float>(-0.4 * std::sin(7.0 * x[0]) * std::sin(5.0 * x[1]));
  }
  const capture::Mesh cage = box_cage(6, 0.5);
  const CageBinding binding(cage, body.rest, h, {}, arena);
  const auto rest_limit = binding.limit_positions(doubles(cage.vertices));
  const auto limit = binding.limit_positions(binding.cage_positions(body.view(), arena));
  const capture::MeshBinding direct(doubles(cage.vertices), body.rest, h, {}, arena);
  const auto naive = binding.limit_positions(direct.positions(body.view(), arena));
  double error = 0.0;
  double naive_error = 0.0;
  for (std::size_t v = 0; v < limit.size(); ++v) {
    error = std::max(error, (limit[v] - wave(rest_limit[v])).norm());
    naive_error = std::max(naive_error, (naive[v] - wave(rest_limit[v])).norm());
  }
  EXPECT_LT(error, 0.006);
  EXPECT_GT(naive_error, 2.0 * error);
}

TEST(CageBinding, RefusesBrokenCages) {
  Arena arena(1);
  const Specimen body = cube(0.1, 0.2);
  capture::Mesh cage = box_cage(1, 0.2);
  cage.face_vertices[3] = 99;
  EXPECT_NE(
      message_of(ErrorKind::kInput, [&] { const CageBinding b(cage, body.rest, 0.1, {}, arena); })
          .find("vertex 99"),
      std::string::npos);
  cage.face_vertices.pop_back();
  message_of(ErrorKind::kInput, [&] { const CageBinding b(cage, body.rest, 0.1, {}, arena); });
}

}  // namespace
}  // namespace matterfit::bake
