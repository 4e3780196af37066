// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/random_solids.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "base/random.hpp"
#include "capture/fill.hpp"

namespace matterfit::bench {
namespace {

using capture::Mesh;

constexpr double kGravity = 9.81;

Vec3d random_direction(Random& random) {
  const double z = random.between(-1.0, 1.0);
  const double angle = random.between(0.0, 2.0 * std::numbers::pi);
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

Quatd random_turn(Random& random) {
  const Vec3d axis = random_direction(random);
  return Quatd(Eigen::AngleAxisd(random.between(0.0, 2.0 * std::numbers::pi), axis));
}

/// A sheet of rows × columns quads whose columns close; its rows close too (`ring`), or end in two
/// poles, the last two vertices.
template <class Place>
Mesh sheet(int rows, int columns, bool ring, const Place& place) {
  Mesh mesh;
  const int lines = ring ? rows : rows - 1;
  mesh.vertices.reserve(static_cast<std::size_t>(lines) * static_cast<std::size_t>(columns) + 2);
  for (int r = 0; r < lines; ++r)
    for (int c = 0; c < columns; ++c) {
      const double u = (ring ? r : r + 1.0) / rows;
      mesh.vertices.push_back(place(u, static_cast<double>(c) / columns).template cast<float>());
    }
  const auto at = [&](int r, int c) { return (r % lines) * columns + c % columns; };
  const auto face = [&](std::initializer_list<int> corners) {
    mesh.face_sizes.push_back(static_cast<std::int32_t>(corners.size()));
    mesh.face_vertices.insert(mesh.face_vertices.end(), corners);
  };
  for (int r = 0; r < (ring ? lines : lines - 1); ++r)
    for (int c = 0; c < columns; ++c) {
      face({at(r, c), at(r + 1, c), at(r + 1, c + 1), at(r, c + 1)});
    }
  if (ring) return mesh;
  const auto top = static_cast<int>(mesh.vertices.size());
  mesh.vertices.push_back(place(0.0, 0.0).template cast<float>());
  mesh.vertices.push_back(place(1.0, 0.0).template cast<float>());
  for (int c = 0; c < columns; ++c) {
    face({top, at(0, c), at(0, c + 1)});
    face({top + 1, at(lines - 1, c + 1), at(lines - 1, c)});
  }
  return mesh;
}

/// Direction of a place on the sheet, from pole to pole.
Vec3d on_sphere(double u, double v) {
  const double polar = std::numbers::pi * u;
  const double angle = 2.0 * std::numbers::pi * v;
  return {std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle), std::cos(polar)};
}

/// A ball whose radius is one plus a sum of low spherical harmonics (products of the direction's
/// components, up to the third order).
Mesh blob(Random& random) {
  std::array<double, 16> amplitude{};
  for (double& a : amplitude) a = random.between(-0.35, 0.35);
  return sheet(24, 32, false, [&](double u, double v) -> Vec3d {
    const Vec3d n = on_sphere(u, v);
    const std::array<double, 16> harmonics = {n[0] * n[1],
                                              n[1] * n[2],
                                              n[0] * n[2],
                                              n[0] * n[0] - 0.33,
                                              n[1] * n[1] - 0.33,
                                              n[0] * n[1] * n[2],
                                              n[0],
                                              n[1],
                                              n[2],
                                              n[0] * n[0] * n[1],
                                              n[1] * n[1] * n[2],
                                              n[2] * n[2] * n[0],
                                              n[0] * n[0] * n[2],
                                              n[1] * n[1] * n[0],
                                              n[2] * n[2] * n[1],
                                              n[2] * n[2] * n[2]};
    double radius = 1.0;
    for (std::size_t i = 0; i < harmonics.size(); ++i) radius += amplitude[i] * harmonics[i];
    return std::max(radius, 0.25) * n;
  });
}

/// A box of half extents `half` with round edges: a superellipsoid.
Mesh bevelled_box(const Vec3d& half, double exponent) {
  return sheet(24, 32, false, [&](double u, double v) -> Vec3d {
    const Vec3d n = on_sphere(u, v);
    const double norm = std::pow(n.array().abs().pow(exponent).sum(), 1.0 / exponent);
    return half.cwiseProduct(n) / norm;
  });
}

Mesh torus(double thickness) {
  return sheet(24, 12, true, [&](double u, double v) -> Vec3d {
    const double around = 2.0 * std::numbers::pi * u;
    const double across = -2.0 * std::numbers::pi * v;
    const double r = 1.0 + thickness * std::cos(across);
    return {r * std::cos(around), r * std::sin(around), thickness * std::sin(across)};
  });
}

Mesh cylinder(double radius) {
  return sheet(8, 32, false, [&](double u, double v) -> Vec3d {
    const double angle = 2.0 * std::numbers::pi * v;
    const double r = u > 0.0 && u < 1.0 ? radius : 0.0;
    const double z = u < 0.5 ? 1.0 : -1.0;
    const double inner = u > 0.2 && u < 0.8 ? 1.0 : 0.6;
    const double side = u > 0.2 && u < 0.8 ? std::clamp((0.5 - u) / 0.25, -1.0, 1.0) : z;
    return {inner * r * std::cos(angle), inner * r * std::sin(angle), side};
  });
}

void append(Mesh& mesh, const Mesh& other) {
  const auto first = static_cast<std::int32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
  mesh.face_sizes.insert(mesh.face_sizes.end(), other.face_sizes.begin(), other.face_sizes.end());
  mesh.face_vertices.reserve(mesh.face_vertices.size() + other.face_vertices.size());
  for (const std::int32_t v : other.face_vertices) mesh.face_vertices.push_back(first + v);
}

Mesh cross(double thickness) {
  Mesh mesh = bevelled_box({1.0, thickness, thickness}, 12.0);
  append(mesh, bevelled_box({thickness, 1.0, thickness}, 12.0));
  append(mesh, bevelled_box({thickness, thickness, 1.0}, 12.0));
  return mesh;
}

void scale_and_turn(Mesh& mesh, Random& random) {
  const Vec3d scale(random.between(0.6, 1.4), random.between(0.6, 1.4), random.between(0.6, 1.4));
  const Quatd turn = random_turn(random);
  for (Vec3f& x : mesh.vertices) {
    x = (turn * scale.cwiseProduct(x.cast<double>())).cast<float>();
  }
}

shape::ColliderPtr floor_like(const std::string& name, const Vec3d& normal) {
  return shape::make_plane(name, shape::Contact{}, Vec3d::Zero(), normal);
}

}  // namespace

RandomMesh random_mesh(std::uint64_t seed) {
  Random random(seed);
  RandomMesh result;
  switch (random.next() % 6) {
    case 0:
      result = {blob(random), "blob"};
      break;
    case 1:
      result = {bevelled_box(Vec3d::Ones(), random.between(4.0, 30.0)), "box"};
      break;
    case 2:
      result = {bevelled_box({1.0, random.between(0.5, 1.0), random.between(0.06, 0.15)}, 16.0),
                "plate"};
      break;
    case 3:
      result = {torus(random.between(0.2, 0.5)), "torus"};
      break;
    case 4:
      result = {cross(random.between(0.2, 0.4)), "cross"};
      break;
    default:
      result = {cylinder(random.between(0.25, 1.0)), "cylinder"};
  }
  scale_and_turn(result.mesh, random);
  return result;
}

RandomThrow random_throw(std::uint64_t seed, const ThrowSetting& setting,
                         const capture::Mesh* mesh) {
  RandomMesh made = mesh != nullptr ? RandomMesh{*mesh, "mesh"} : random_mesh(seed);
  Random random(seed ^ 0x7468726f77ULL);
  if (mesh != nullptr) scale_and_turn(made.mesh, random);
  const double scale = random.log_between(0.03, 0.3);
  for (Vec3f& x : made.mesh.vertices) x *= static_cast<float>(scale);

  // Filled twice: coarsely for the volume, then with about the particles that were asked for.
  capture::FillOptions options;
  Vec3f low = made.mesh.vertices.front();
  Vec3f high = low;
  for (const Vec3f& x : made.mesh.vertices) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  options.separation = 0.04 * static_cast<double>((high - low).maxCoeff());
  const double volume = capture::fill_mesh(made.mesh, options).volume;
  options.separation = std::cbrt(volume / setting.particles);
  capture::FilledBody filled = capture::fill_mesh(made.mesh, options);

  RandomThrow result;
  result.size = std::cbrt(6.0 * volume / std::numbers::pi);
  mpm::Body body;
  body.name = made.shape;
  body.formulation = setting.formulation;
  constexpr material::Law kLaws[] = {material::Law::kFixedCorotated, material::Law::kNeoHookean,
                                     material::Law::kStvkHencky};
  body.material.law = kLaws[random.next() % 3];
  body.material.youngs_modulus = random.log_between(1e5, 2.64e5);
  // One in eight as incompressible as the rubber: it takes ten times the substeps.
  body.material.poisson_ratio = random.next() % 8 == 0 ? 0.499 : random.between(0.2, 0.45);
  body.density = random.between(1000.0, 1070.0);
  body.velocity = random.between(0.0, 6.0) * random_direction(random);
  body.spin = random.between(0.0, 12.0) * random_direction(random);

  const std::uint64_t target = random.next() % 3;
  Vec3d centre = Vec3d::Zero();
  for (std::size_t p = 0; p < filled.positions.size(); ++p) {
    centre += filled.volumes[p] * filled.positions[p];
  }
  centre /= volume;
  double reach = 0.0;
  for (const Vec3d& x : filled.positions) reach = std::max(reach, (x - centre).norm());
  reach += options.separation;
  // Clear of everything at the start, and thrown at it.
  Vec3d place(0.0, 0.0, reach + random.between(0.0, 2.0) * result.size);
  mpm::Scene& scene = result.scene;
  scene.colliders.push_back(floor_like("floor", Vec3d::UnitZ()));
  if (target == 1) {
    const double radius = random.between(0.3, 1.5) * result.size;
    place[2] += 2.0 * radius;
    shape::Pose pose;
    pose.position = Vec3d(random.between(-0.3, 0.3) * result.size, 0.0, radius);
    scene.colliders.push_back(
        shape::make_sphere("ball", shape::Contact{}, radius, shape::Keyed<shape::Pose>(pose)));
    body.velocity[2] = -std::abs(body.velocity[2]);
  } else if (target == 2) {
    scene.colliders.push_back(floor_like("wall x", Vec3d::UnitX()));
    scene.colliders.push_back(floor_like("wall y", Vec3d::UnitY()));
    for (int axis = 0; axis < 3; ++axis) body.velocity[axis] = -std::abs(body.velocity[axis]);
    place[0] = place[1] = reach + random.between(0.0, 0.5) * result.size;
  }
  capture::place(filled, place - centre, Quatd::Identity());
  capture::take_filled(body, std::move(filled));

  double spin_energy = 0.0;  // per mass
  for (std::size_t p = 0; p < body.rest.size(); ++p) {
    spin_energy +=
        0.5 * body.volumes[p] / volume * body.spin.cross(body.rest[p] - place).squaredNorm();
  }
  result.height = place[2] + (0.5 * body.velocity.squaredNorm() + spin_energy) / kGravity;
  scene.dx = 2.0 * options.separation;
  scene.fps = 24.0;
  scene.end_frame = 1 + static_cast<int>(std::ceil(setting.seconds * scene.fps));
  char words[160];
  constexpr const char* kTargets[] = {"floor", "ball", "corner"};
  std::snprintf(words, sizeof words, "%s, %s E %.2g nu %.3f, %.2f m, %.1f m/s, %.0f rad/s, %s",
                made.shape.c_str(), std::string(body.material.traits().name).c_str(),
                body.material.youngs_modulus, body.material.poisson_ratio, result.size,
                body.velocity.norm(), body.spin.norm(), kTargets[target]);
  result.words = words;
  scene.bodies.push_back(std::move(body));
  return result;
}

ThrowResult run_throw(const RandomThrow& thrown, int threads) {
  ThrowResult result;
  try {
    mpm::Simulation::Options options;
    options.hand_over = true;
    mpm::Simulation simulation(thrown.scene, std::make_shared<Arena>(threads), options);
    const Interrupter interrupter;
    const std::vector<double>& volumes = thrown.scene.bodies.front().volumes;
    while (simulation.frame() + 1 < thrown.scene.end_frame) {
      const mpm::FrameReport report = simulation.advance(interrupter);
      result.frames = report.frame;
      result.penetration = std::max(result.penetration, report.max_penetration);
      result.least_volume = std::min(result.least_volume, report.min_volume_ratio);
      result.substeps += report.substeps;
      result.notes += report.note;
      result.retried += report.dt_limit.find("halved") != std::string::npos ? 1 : 0;
      const mpm::FrameState state = simulation.state();
      double height = 0.0;
      double sum = 0.0;
      for (std::size_t p = 0; p < volumes.size(); ++p) {
        height += volumes[p] * static_cast<double>(state.bodies[0].positions[p][2]);
        sum += volumes[p];
      }
      result.highest = std::max(result.highest, height / sum);
    }
    result.ran = true;
  } catch (const Error& error) {
    result.error = error.what();
  }
  return result;
}

bool is_right(const RandomThrow& thrown, const ThrowResult& result) {
  return result.ran && result.highest <= thrown.height + 0.01 * thrown.size &&
         result.penetration <= 0.1 * thrown.size;
}

}  // namespace matterfit::bench
