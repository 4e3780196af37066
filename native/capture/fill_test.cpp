// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/fill.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "base/error.hpp"
#include "capture/fill_lattice.hpp"
#include "capture/limit_surface.hpp"
#include "shape/mesh_shapes_for_test.hpp"

namespace matterfit::capture {
namespace {

using shape::PolygonArrays;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
namespace shapes = shape::test_shapes;

Mesh mesh_of(const PolygonArrays& arrays) {
  Mesh mesh;
  mesh.vertices = arrays.vertices;
  mesh.face_sizes = arrays.face_sizes;
  mesh.face_vertices = arrays.face_vertices;
  return mesh;
}

FillOptions spaced(double separation) {
  FillOptions options;
  options.separation = separation;
  return options;
}

double sum_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

Vec3d centre_of_mass(const FilledBody& body) {
  Vec3d centre = Vec3d::Zero();
  for (std::size_t i = 0; i < body.positions.size(); ++i) {
    centre += body.volumes[i] * body.positions[i];
  }
  return centre / sum_of(body.volumes);
}

/// Every particle of a regular body lies in the centre of a cell of its lattice.
void expect_on_lattice(const FilledBody& body) {
  ASSERT_TRUE(body.lattice.regular);
  for (const Vec3d& x : body.positions) {
    const Vec3d cell =
        (body.lattice.axes.conjugate() * (x - body.lattice.origin)) / body.lattice.spacing -
        Vec3d::Constant(0.5);
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_NEAR(cell[axis], std::round(cell[axis]), 1e-6);
    }
  }
}

TEST(CubeFraction, KnownCuts) {
  EXPECT_DOUBLE_EQ(cube_fraction(2.0, Vec3d::UnitX()), 0.0);
  EXPECT_DOUBLE_EQ(cube_fraction(-2.0, Vec3d::UnitX()), 1.0);
  EXPECT_NEAR(cube_fraction(0.0, Vec3d(1, 2, 3).normalized()), 0.5, 1e-12);
  EXPECT_NEAR(cube_fraction(-0.3, Vec3d::UnitZ()), 0.8, 1e-3);
  // A corner cut off 0.2 along each side, and all but that corner.
  const double corner = 1.3 / std::sqrt(3.0);
  EXPECT_NEAR(cube_fraction(corner, Vec3d::Ones().normalized()), 0.008 / 6.0, 1e-12);
  EXPECT_NEAR(cube_fraction(-corner, Vec3d::Ones().normalized()), 1.0 - 0.008 / 6.0, 1e-12);
  const Vec3d n = Vec3d(0.3, -0.5, 0.7).normalized();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(-0.5, 0.5);
  for (const double d : {-0.6, -0.2, 0.1, 0.4}) {
    int inside = 0;
    for (int i = 0; i < 200000; ++i) {
      const double x = unit(random);
      const double y = unit(random);
      inside += n.dot(Vec3d(x, y, unit(random))) + d < 0;
    }
    EXPECT_NEAR(cube_fraction(d, n), inside / 200000.0, 0.004) << d;
  }
}

TEST(Fill, BoxOfWholeCellsIsExact) {
  const auto body = fill_box(Vec3d(-0.015, -0.015, 0), Vec3d(0.015, 0.015, 0.1), spaced(0.0025));
  ASSERT_EQ(body.positions.size(), 12U * 12U * 40U);
  expect_on_lattice(body);
  for (const double volume : body.volumes) EXPECT_DOUBLE_EQ(volume, std::pow(0.0025, 3));
  EXPECT_NEAR((centre_of_mass(body) - Vec3d(0, 0, 0.05)).norm(), 0.0, 1e-12);
  double lowest = 1;
  for (const Vec3d& x : body.positions) lowest = std::min(lowest, x.z());
  EXPECT_NEAR(lowest, 0.00125, 1e-12);
}

TEST(Fill, BoxMeshOfWholeCellsIsExact) {
  const auto mesh = mesh_of(shapes::box(Vec3f(0, -0.015F, 3), Vec3f(0.1F, 0.015F, 3.03F)));
  const auto body = fill_mesh(mesh, spaced(0.0025));
  ASSERT_EQ(body.positions.size(), 12U * 12U * 40U);
  for (const double volume : body.volumes) EXPECT_DOUBLE_EQ(volume, std::pow(0.0025, 3));
  expect_on_lattice(body);
}

TEST(Fill, BoxBetweenCellsKeepsItsVolume) {
  FillOptions options = spaced(0.01);
  options.anchor = Vec3d(0.003, 0.007, -0.004);  // faces cut cells at .3, .7, .6
  const Vec3d low(0, 0, 0);
  const Vec3d high(0.1, 0.12, 0.08);
  for (const bool turned : {false, true}) {
    options.axes =
        turned ? Quatd(Eigen::AngleAxisd(0.4, Vec3d(1, 2, 3).normalized())) : Quatd::Identity();
    const auto body = fill_box(low, high, options);
    const double volume = 0.1 * 0.12 * 0.08;
    EXPECT_NEAR(sum_of(body.volumes), volume, 1e-6 * volume);
    EXPECT_NEAR((centre_of_mass(body) - 0.5 * (low + high)).norm(), 0.0, 0.0025);
    expect_on_lattice(body);
    // A face of cells goes through the anchor.
    const Vec3d faces = body.lattice.axes.conjugate() * (*options.anchor - body.lattice.origin) /
                        options.separation;
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(faces[axis], std::round(faces[axis]), 1e-9);
  }
}

/// The unscaled sum must be right too: a mesh with a doubled box has no known volume to scale to.
TEST(Fill, VolumeWithoutScaling) {
  const auto cut =
      mesh_of(shapes::joined(shapes::box(Vec3f(0, 0, 0), Vec3f(0.1F, 0.12F, 0.08F)),
                             shapes::box(Vec3f(0.05F, 0, 0), Vec3f(0.2F, 0.12F, 0.08F))));
  FillOptions options = spaced(0.01);
  options.anchor = Vec3d(0.003, 0.007, -0.004);
  options.axes = Quatd(Eigen::AngleAxisd(0.4, Vec3d(1, 2, 3).normalized()));
  const auto body = fill_mesh(cut, options);
  const double volume = 0.2 * 0.12 * 0.08;
  EXPECT_NEAR(sum_of(body.volumes), volume, 0.005 * volume) << body.report;
}

TEST(Fill, SphereAndCylinder) {
  const double exact = 4.0 / 3.0 * std::numbers::pi * std::pow(0.05, 3);
  const auto ball = fill_sphere(Vec3d(1, 2, 3), 0.05, spaced(0.005));
  EXPECT_NEAR(sum_of(ball.volumes), exact, 1e-6 * exact);
  // A cell of which a third lies inside has a particle: as many as cells, and some of the skin's.
  const double cells = exact / std::pow(0.005, 3);
  EXPECT_GT(static_cast<double>(ball.positions.size()), cells);
  EXPECT_LT(static_cast<double>(ball.positions.size()), 1.08 * cells);
  EXPECT_NEAR((centre_of_mass(ball) - Vec3d(1, 2, 3)).norm(), 0, 2e-8);

  // A mesh between whose facets and the sphere lie .02 %: its own volume is kept.
  const auto mesh = fill_mesh(mesh_of(shapes::sphere(Vec3f(1, 2, 3), 0.05F, 80)), spaced(0.005));
  EXPECT_NEAR(sum_of(mesh.volumes), exact, 0.003 * exact);
  EXPECT_THAT(mesh.report, HasSubstr("100.00 %"));

  const auto rod = fill_cylinder(Vec3d(0, 0, 0), 0.03, 0.2, Vec3d(1, 1, 0), spaced(0.004));
  const double rod_volume = std::numbers::pi * 0.03 * 0.03 * 0.2;
  EXPECT_NEAR(sum_of(rod.volumes), rod_volume, 1e-6 * rod_volume);
  for (const Vec3d& x : rod.positions) {
    EXPECT_LT(std::abs(x.dot(Vec3d(1, 1, 0).normalized())), 0.1 + 0.004);
  }
}

TEST(Fill, SkinIsTheSurfaceThatWasFilled) {
  const Vec3d centre(1, 2, 3);
  const auto mesh = fill_mesh(mesh_of(shapes::sphere(Vec3f(1, 2, 3), 0.05F, 80)), spaced(0.005));
  ASSERT_GT(mesh.skin.size(), 1000U);
  for (const mpm::SkinPlane& plane : mesh.skin) {
    const Vec3d arm = mesh.positions[plane.particle] - centre;
    // Tangent to the ball, and no farther than the particle is from its surface.
    EXPECT_NEAR(arm.dot(plane.normal) + plane.depth, 0.05, 5e-5);
    EXPECT_GT(plane.normal.dot(arm.normalized()), 0.9);
  }
  // A box between lattice planes: each particle in a corner knows its three faces.
  const auto box = fill_box(Vec3d::Zero(), Vec3d(0.0231, 0.0231, 0.0231), spaced(0.005));
  std::vector<int> planes(box.positions.size(), 0);
  for (const mpm::SkinPlane& plane : box.skin) {
    EXPECT_NEAR(plane.normal.cwiseAbs().maxCoeff(), 1.0, 1e-9);
    ++planes[plane.particle];
  }
  EXPECT_EQ(std::count(planes.begin(), planes.end(), 3), 8);
  EXPECT_TRUE(std::is_sorted(box.skin.begin(), box.skin.end(),
                             [](const auto& a, const auto& b) { return a.particle < b.particle; }));
  // Jittered bodies flow and have no skin.
  FillOptions jittered = spaced(0.005);
  jittered.jitter = true;
  EXPECT_TRUE(fill_sphere(centre, 0.05, jittered).skin.empty());
}

TEST(Fill, ScaleDoesNotMatter) {
  for (const double scale : {1e-4, 1.0, 1e4}) {
    const auto ball = fill_sphere(Vec3d::Zero(), 0.05 * scale, spaced(0.01 * scale));
    EXPECT_EQ(ball.positions.size(),
              fill_sphere(Vec3d::Zero(), 0.05, spaced(0.01)).positions.size());
    EXPECT_NEAR(sum_of(ball.volumes) / std::pow(scale, 3), 5.23599e-4, 1e-8);
  }
}

TEST(Fill, ConcaveL) {
  // An L of three unit squares, extruded: one polygon with a reflex corner at top and bottom.
  Mesh mesh;
  const std::vector<Vec3f> outline = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0},
                                      {1, 1, 0}, {1, 2, 0}, {0, 2, 0}};
  for (const Vec3f& p : outline) mesh.vertices.push_back(p);
  for (const Vec3f& p : outline) mesh.vertices.push_back(p + Vec3f(0, 0, 1));
  mesh.face_sizes = {6, 6};
  mesh.face_vertices = {5, 4, 3, 2, 1, 0, 6, 7, 8, 9, 10, 11};
  for (std::int32_t i = 0; i < 6; ++i) {
    const std::int32_t j = (i + 1) % 6;
    mesh.face_sizes.push_back(4);
    for (const std::int32_t v : {i, j, j + 6, i + 6}) mesh.face_vertices.push_back(v);
  }
  const auto body = fill_mesh(mesh, spaced(0.1));
  EXPECT_EQ(body.positions.size(), 3000U);
  for (const Vec3d& x : body.positions) EXPECT_FALSE(x.x() > 1 && x.y() > 1);
}

TEST(Fill, BoxWithoutLidSaysSo) {
  const auto body =
      fill_mesh(mesh_of(shapes::box(Vec3f(0, 0, 0), Vec3f(1, 1, 1), false)), spaced(0.1));
  EXPECT_EQ(body.positions.size(), 1000U);
  EXPECT_NEAR(sum_of(body.volumes), 1.0, 1e-4);
  EXPECT_THAT(body.report, HasSubstr("4 boundary edges around 1 hole"));
}

TEST(Fill, InvertedBoxIsTurned) {
  const auto body = fill_mesh(
      mesh_of(shapes::inverted(shapes::box(Vec3f(0, 0, 0), Vec3f(1, 1, 1)))), spaced(0.1));
  EXPECT_EQ(body.positions.size(), 1000U);
  EXPECT_THAT(body.report, HasSubstr("faced inward"));
}

TEST(Fill, SomeFacesTurned) {
  auto arrays = shapes::box(Vec3f(0, 0, 0), Vec3f(1, 1, 1));
  std::reverse(arrays.face_vertices.begin(), arrays.face_vertices.begin() + 4);
  const auto body = fill_mesh(mesh_of(arrays), spaced(0.1));
  EXPECT_EQ(body.positions.size(), 1000U);
  EXPECT_THAT(body.report, HasSubstr("2 triangles faced the other way"));
}

TEST(Fill, TwoSpheresAndAHollowOne) {
  const auto two = shapes::joined(shapes::sphere(Vec3f(0, 0, 0), 0.1F, 40),
                                  shapes::sphere(Vec3f(0.3F, 0, 0), 0.05F, 40));
  const double volume = 4.0 / 3.0 * std::numbers::pi * (std::pow(0.1, 3) + std::pow(0.05, 3));
  EXPECT_NEAR(sum_of(fill_mesh(mesh_of(two), spaced(0.01)).volumes), volume, 0.005 * volume);

  const auto hollow = shapes::joined(shapes::sphere(Vec3f(0, 0, 0), 0.1F, 40),
                                     shapes::inverted(shapes::sphere(Vec3f(0, 0, 0), 0.05F, 40)));
  const double rest = 4.0 / 3.0 * std::numbers::pi * (std::pow(0.1, 3) - std::pow(0.05, 3));
  const auto body = fill_mesh(mesh_of(hollow), spaced(0.01));
  EXPECT_NEAR(sum_of(body.volumes), rest, 0.005 * rest);
  for (const Vec3d& x : body.positions) EXPECT_GT(x.norm(), 0.045);
}

TEST(Fill, BottleWithANarrowNeckIsNotFilled) {
  // A hollow box whose cavity is joined to the outside by a slit far narrower than a cell: the
  // outer shell has a square hole, the inner one too, and a tube joins them.
  PolygonArrays mesh = shapes::joined(
      shapes::box(Vec3f(0, 0, 0), Vec3f(1, 1, 1), false),
      shapes::inverted(shapes::box(Vec3f(0.2F, 0.2F, 0.2F), Vec3f(0.8F, 0.8F, 0.8F), false)));
  const float a = 0.495F;
  const float b = 0.505F;
  const auto first = static_cast<std::int32_t>(mesh.vertices.size());
  for (const float z : {1.0F, 0.8F}) {
    mesh.vertices.insert(mesh.vertices.end(), {{a, a, z}, {b, a, z}, {a, b, z}, {b, b, z}});
  }
  // Corners of a lid: 4, 5, 6, 7 of each box (x fastest).
  const auto ring = [&](std::int32_t outer, std::int32_t inner, bool up) {
    const int order[5] = {0, 1, 3, 2, 0};
    for (int i = 0; i < 4; ++i) {
      std::vector<std::int32_t> face = {outer + order[i], outer + order[i + 1],
                                        inner + order[i + 1], inner + order[i]};
      if (!up) std::reverse(face.begin(), face.end());
      mesh.face_sizes.push_back(4);
      mesh.face_vertices.insert(mesh.face_vertices.end(), face.begin(), face.end());
    }
  };
  ring(4, first, true);
  ring(12, first + 4, false);
  ring(first, first + 4, true);
  const auto body = fill_mesh(mesh_of(mesh), spaced(0.1));
  const double volume = 1.0 - std::pow(0.6, 3) - 0.2 * 0.01 * 0.01;
  EXPECT_NEAR(sum_of(body.volumes), volume, 0.005) << body.report;
  for (const Vec3d& x : body.positions) {
    EXPECT_FALSE((x - Vec3d::Constant(0.5)).cwiseAbs().maxCoeff() < 0.25) << x.transpose();
  }
}

TEST(Fill, CageIsFilledToItsLimit) {
  const auto cage = mesh_of(shapes::box(Vec3f(-1, -1, -1), Vec3f(1, 1, 1)));
  // The limit's volume from two fine levels, extrapolated (error ∝ 4^−level).
  const auto volume_at = [&](int level) {
    LimitOptions options;
    options.level = level;
    const Mesh fine = limit_mesh(cage, options);
    double volume = 0;
    for (std::size_t f = 0; f < fine.face_sizes.size(); ++f) {
      const auto p = [&](std::size_t i) {
        return Vec3d(
            fine.vertices[static_cast<std::size_t>(fine.face_vertices[4 * f + i])].cast<double>());
      };
      volume += (p(0).dot(p(1).cross(p(2))) + p(0).dot(p(2).cross(p(3)))) / 6.0;
    }
    return volume;
  };
  const double exact = volume_at(6) + (volume_at(6) - volume_at(5)) / 3.0;
  const auto body = fill_cage(cage, spaced(0.1));
  EXPECT_NEAR(sum_of(body.volumes), exact, 0.002 * exact) << body.report;
  // Corner of the cube's limit: (corner·9 + Σ edges·4 + Σ faces)/(3·8) of valence 3 masks = .5.
  double farthest = 0;
  for (const Vec3f& p : limit_mesh(cage).vertices)
    farthest = std::max(farthest, double(p.x() + p.y() + p.z()));
  EXPECT_NEAR(farthest, 1.5, 1e-6);
}

TEST(Fill, SmoothCageHasFacetsAsTheSeparationNeedsThem) {
  const auto cage = mesh_of(shapes::box(Vec3f(-1, -1, -1), Vec3f(1, 1, 1)));
  // Facets of half a separation would be those of level 7.
  const auto body = fill_cage(cage, spaced(0.05));
  EXPECT_THAT(body.report, HasSubstr("at level 5."));
  const auto fine = fill_mesh(limit_mesh(cage, {7}), spaced(0.05));
  EXPECT_NEAR(body.volume, fine.volume, 0.001 * fine.volume);
  EXPECT_NEAR(double(body.positions.size()), double(fine.positions.size()),
              0.01 * double(fine.positions.size()));
  // A flat one needs no more than was asked for, a blunt crease what it is rounded by.
  Mesh plate = mesh_of(shapes::box(Vec3f(-1, -1, -1), Vec3f(1, 1, 1)));
  for (std::int32_t v = 0; v < 8; ++v) {
    for (const std::int32_t bit : {1, 2, 4}) {
      if (v & bit) continue;
      plate.crease_edges.insert(plate.crease_edges.end(), {v, v | bit});
      plate.crease_sharpness.push_back(10.0F);
    }
  }
  EXPECT_THAT(fill_cage(plate, spaced(0.2)).report, HasSubstr("at level 2."));
  for (float& sharpness : plate.crease_sharpness) sharpness = 3.5F;
  EXPECT_THAT(fill_cage(plate, spaced(0.2)).report, HasSubstr("at level 5."));
}

TEST(Fill, AnswersCancel) {
  Interrupter interrupter;
  FillOptions options = spaced(0.1);
  options.interrupter = &interrupter;
  const auto cage = mesh_of(shapes::box(Vec3f(-1, -1, -1), Vec3f(1, 1, 1)));
  EXPECT_EQ(fill_mesh(cage, options).positions.size(), 8000U);
  interrupter.cancel();
  for (const auto& fill : std::vector<std::function<void()>>{
           [&] { (void)fill_box(Vec3d::Zero(), Vec3d::Ones(), options); },
           [&] { (void)fill_mesh(cage, options); }, [&] { (void)fill_cage(cage, options); }}) {
    try {
      fill();
      ADD_FAILURE() << "went on";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kCancelled) << error.what();
    }
  }
}

TEST(Fill, InfinitelyCreasedCageIsTheCube) {
  auto cage = mesh_of(shapes::box(Vec3f(-1, -1, -1), Vec3f(1, 1, 1)));
  for (std::int32_t v = 0; v < 8; ++v) {
    for (const std::int32_t bit : {1, 2, 4}) {
      if (v & bit) continue;
      cage.crease_edges.insert(cage.crease_edges.end(), {v, v | bit});
      cage.crease_sharpness.push_back(10.0F);
    }
  }
  EXPECT_EQ(fill_cage(cage, spaced(0.2)).positions.size(), 1000U);
}

TEST(Fill, ThinPlateHasOneLayer) {
  const auto body = fill_box(Vec3d(0, 0, 0), Vec3d(0.1, 0.1, 0.003), spaced(0.01));
  EXPECT_EQ(body.positions.size(), 100U);
  EXPECT_NEAR(sum_of(body.volumes), 0.1 * 0.1 * 0.003, 1e-9);
  EXPECT_THAT(body.report, HasSubstr("Only 1 layer"));
  const auto mesh =
      fill_mesh(mesh_of(shapes::box(Vec3f(0, 0, 0), Vec3f(0.1F, 0.1F, 0.003F))), spaced(0.01));
  EXPECT_EQ(mesh.positions.size(), 100U);
}

// A cube of 8 cells beside a wire of 2 % of a cell, which no particle has.
TEST(Fill, WiresThatWouldHoldMostOfItAreRefused) {
  const auto with_wire = [](float length) {
    return mesh_of(
        shapes::joined(shapes::box(Vec3f(0, 0, 0), Vec3f(0.02F, 0.02F, 0.02F)),
                       shapes::box(Vec3f(0.03F, 0, 0), Vec3f(0.03F + length, 0.0015F, 0.0015F))));
  };
  const auto most = fill_mesh(with_wire(1.0F), spaced(0.01));
  EXPECT_EQ(most.positions.size(), 8U);
  try {
    (void)fill_mesh(with_wire(6.0F), spaced(0.01));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), MatchesRegex(".*hold only (2|3|4). % of the shape.*"));
  }
  EXPECT_GT(fill_mesh(with_wire(6.0F), spaced(0.002)).positions.size(), 2000U);
}

TEST(Fill, JitterStaysInItsCellAndDependsOnTheSeed) {
  FillOptions options = spaced(0.01);
  options.jitter = true;
  options.seed = 7;
  const auto one = fill_box(Vec3d::Zero(), Vec3d::Constant(0.1), options);
  const auto same = fill_box(Vec3d::Zero(), Vec3d::Constant(0.1), options);
  options.seed = 8;
  const auto other = fill_box(Vec3d::Zero(), Vec3d::Constant(0.1), options);
  options.jitter = false;
  const auto regular = fill_box(Vec3d::Zero(), Vec3d::Constant(0.1), options);
  ASSERT_EQ(one.positions.size(), 1000U);
  EXPECT_FALSE(one.lattice.regular);
  EXPECT_EQ(one.positions, same.positions);
  EXPECT_NE(one.positions, other.positions);
  Vec3d mean = Vec3d::Zero();
  for (std::size_t i = 0; i < 1000; ++i) {
    const Vec3d off = one.positions[i] - regular.positions[i];
    EXPECT_LE(off.cwiseAbs().maxCoeff(), 0.005 + 1e-12);
    mean += off / 1000.0;
  }
  EXPECT_LT(mean.norm(), 5e-4);
}

TEST(Fill, ThreadsDoNotMatter) {
  const auto mesh = mesh_of(shapes::joined(shapes::sphere(Vec3f(0, 0, 0), 0.1F, 20),
                                           shapes::sphere(Vec3f(0.1F, 0, 0), 0.08F, 20)));
  const auto run = [&](int threads) {
    FilledBody body;
    tbb::task_arena(threads).execute([&] { body = fill_mesh(mesh, spaced(0.008)); });
    return body;
  };
  const auto one = run(1);
  const auto two = run(2);
  EXPECT_EQ(one.positions, two.positions);
  EXPECT_EQ(one.volumes, two.volumes);
  EXPECT_EQ(one.report, two.report);
}

TEST(Fill, Refusals) {
  FillOptions options = spaced(0.001);
  options.limit = 1000;
  try {
    (void)fill_box(Vec3d::Zero(), Vec3d::Ones(), options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_THAT(error.what(), HasSubstr("1e+09 particles"));
  }
  EXPECT_THROW((void)fill_box(Vec3d::Ones(), Vec3d::Zero(), spaced(0.1)), Error);
  EXPECT_THROW((void)fill_sphere(Vec3d::Zero(), 1.0, spaced(0.0)), Error);
  EXPECT_THROW((void)fill_sphere(Vec3d::Zero(), 1.0, spaced(1e-9)), Error);
  Mesh plane;
  plane.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  plane.face_sizes = {4};
  plane.face_vertices = {0, 1, 2, 3};
  try {
    (void)fill_mesh(plane, spaced(0.1));
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("Nothing to fill"));
    EXPECT_THAT(error.what(), HasSubstr("4 boundary edges"));
  }
  EXPECT_THROW((void)fill_mesh(Mesh{}, spaced(0.1)), Error);
}

TEST(Fill, PlacedBodyTakesItsLatticeAlong) {
  auto body = fill_box(Vec3d::Zero(), Vec3d(0.1, 0.2, 0.3), spaced(0.02));
  place(body, Vec3d(1, 2, 3), Quatd(Eigen::AngleAxisd(0.7, Vec3d(1, 1, 0).normalized())));
  expect_on_lattice(body);
}

}  // namespace
}  // namespace matterfit::capture
