// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>

#include "mpm/validation_shapes_for_test.hpp"

/// Flows with a known answer. Each function runs one case and returns what it measured.
namespace matterfit::mpm::validation {

inline constexpr double kPull = 9.81;

// --- Dam break
// -------------------------------------------------------------------------------------

/// Martin & Moyce 1952, square-law column n² = 2: T = t √(2g/a) and Z = front/a.
struct DamPoint {
  double t, z;
};
inline constexpr std::array<DamPoint, 8> kDamSmall{{{.849, 1.245},
                                                    {1.212, 1.443},
                                                    {1.602, 1.884},
                                                    {2.283, 2.689},
                                                    {2.950, 3.728},
                                                    {3.598, 4.528},
                                                    {3.905, 4.999},
                                                    {4.592, 5.841}}};  // a = 28.575 mm
inline constexpr std::array<DamPoint, 7> kDamLarge{{{.832, 1.217},
                                                    {1.219, 1.474},
                                                    {1.997, 2.292},
                                                    {2.547, 2.995},
                                                    {3.345, 4.134},
                                                    {4.034, 4.944},
                                                    {4.418, 5.881}}};  // a = 57.15 mm

/// Z at each of the given T for water of column width `a` and height 2a between slip walls two
/// cells apart, by a front of a quarter cell's depth; on a floor of the given kind.
inline std::vector<double> dam_break(double a, const std::vector<double>& scaled_times,
                                     shape::ContactKind floor, int cells, int threads = 1) {
  Scene scene;
  scene.dx = a / cells;
  const double slab = 2 * scene.dx;
  Body body = box_body("water", Vec3d::Zero(), Vec3d(a, slab, 2 * a), 0.5 * scene.dx);
  body.formulation = Formulation::kUpdated;
  body.material.law = material::Law::kNewtonian;
  body.material.viscosity = 1e-3;
  // Sound ten times faster than the front.
  body.material.bulk_modulus = 1000.0 * 100.0 * 4.0 * kPull * a;
  scene.bodies.push_back(std::move(body));
  shape::Contact ground;
  ground.kind = floor;
  scene.colliders.push_back(shape::make_plane("floor", ground, Vec3d::Zero(), Vec3d::UnitZ()));
  shape::Contact slip;
  slip.kind = shape::ContactKind::kSeparating;
  scene.colliders.push_back(shape::make_plane("back", slip, Vec3d::Zero(), Vec3d::UnitX()));
  scene.colliders.push_back(shape::make_plane("left", slip, Vec3d::Zero(), Vec3d::UnitY()));
  scene.colliders.push_back(shape::make_plane("right", slip, Vec3d(0, slab, 0), -Vec3d::UnitY()));
  const double unit = std::sqrt(a / (2 * kPull));
  constexpr int kFramesAUnit = 40;
  scene.fps = kFramesAUnit / unit;
  scene.end_frame = static_cast<int>(std::ceil(scaled_times.back() * kFramesAUnit)) + 2;
  std::vector<double> fronts;
  const double volume = std::pow(0.5 * scene.dx, 3);
  run(scene, threads, [&](const FrameState& state) {
    std::vector<double> depth(static_cast<std::size_t>(20 * cells), 0.0);
    for (const Vec3f& x : state.bodies[0].positions) {
      const double bin = static_cast<double>(x[0]) / scene.dx;
      if (bin < 0 || bin >= static_cast<double>(depth.size())) continue;
      depth[static_cast<std::size_t>(bin)] += volume / (scene.dx * slab);
    }
    std::size_t bin = 0;
    while (bin < depth.size() && depth[bin] > 0.25 * scene.dx) ++bin;
    // Within the last bin: the outermost particle that still belongs to the front.
    double front = 0.0;
    for (const Vec3f& x : state.bodies[0].positions) {
      if (static_cast<double>(x[0]) < static_cast<double>(bin) * scene.dx) {
        front = std::max(front, static_cast<double>(x[0]));
      }
    }
    fronts.push_back((front + 0.25 * scene.dx) / a);
    return true;
  });
  std::vector<double> result;
  for (const double t : scaled_times) {
    const double at = t * kFramesAUnit;
    const auto i = static_cast<std::size_t>(at);
    const double s = at - static_cast<double>(i);
    result.push_back((1 - s) * fronts[i] + s * fronts[i + 1]);
  }
  return result;
}

// --- Granular column
// -------------------------------------------------------------------------------

struct Column {
  double runout = 0.0;    ///< (r∞ − r₀)/r₀ of the heap's edge
  double outer = 0.0;     ///< the same of the radius within which 99 % of the sand lies
  double height = 0.0;    ///< h∞/r₀
  double expected = 0.0;  ///< Lube et al. 2004
};

/// The friction angle [degrees] of a Drucker-Prager material whose slopes hold up to `slope`
/// [degrees], as an angle of repose is measured: in simple shear its cone, which meets
/// Mohr-Coulomb's in triaxial compression, has τ/p = 2√3 sin φ/(3 − sin φ).
inline double friction_angle_of_slope(double slope) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  const double t = std::tan(slope * kDegree);
  return std::asin(3.0 * t / (2.0 * std::sqrt(3.0) + t)) / kDegree;
}

/// Dry sand whose slopes hold up to 30°, released from a cylinder of radius r₀ and height a·r₀ on a
/// floor of the same friction.
inline Column sand_column(double aspect, int cells, shape::ContactMethod method, int threads = 1,
                          Formulation formulation = Formulation::kUpdated) {
  constexpr double kSlope = 30.0;
  constexpr double kRadius = 0.05;
  Scene scene;
  scene.dx = kRadius / cells;
  const double spacing = 0.5 * scene.dx;
  const double height = std::round(aspect * kRadius / spacing) * spacing;
  Body body =
      lattice_body("sand", Vec3d(-kRadius, -kRadius, 0), Vec3d(kRadius, kRadius, height), spacing,
                   [](const Vec3d& x) { return std::hypot(x[0], x[1]) < kRadius; });
  body.formulation = formulation;
  body.density = 1600;
  body.material.law = material::Law::kDruckerPrager;
  body.material.youngs_modulus = 5e5;
  body.material.poisson_ratio = 0.2;
  body.material.friction_angle = friction_angle_of_slope(kSlope);
  scene.bodies.push_back(std::move(body));
  shape::Contact ground;
  ground.kind = shape::ContactKind::kFriction;
  ground.mu = std::tan(kSlope * std::numbers::pi / 180);
  ground.method = method;
  scene.colliders.push_back(shape::make_plane("floor", ground, Vec3d::Zero(), Vec3d::UnitZ()));
  const double fall = std::sqrt(height / kPull);
  scene.fps = 100;
  scene.end_frame = 2 + static_cast<int>(std::ceil(6 * fall * scene.fps));
  Column result;
  result.expected = aspect < 1.7 ? 1.24 * aspect : 1.6 * std::sqrt(aspect);
  run(scene, threads, [&](const FrameState& state) {
    if (state.frame + 1 < scene.end_frame) return true;
    // The edge of the heap: where a ring of half a cell is still covered to a quarter cell's depth.
    std::vector<double> rings(static_cast<std::size_t>(30 * cells), 0.0);
    double top = 0.0;
    std::vector<double> radii;
    radii.reserve(state.bodies[0].positions.size());
    for (const Vec3f& x : state.bodies[0].positions) {
      const double r = std::hypot(static_cast<double>(x[0]), static_cast<double>(x[1]));
      radii.push_back(r);
      const auto ring = static_cast<std::size_t>(r / spacing);
      if (ring < rings.size()) rings[ring] += std::pow(spacing, 3);
      if (r < scene.dx) top = std::max(top, static_cast<double>(x[2]));
    }
    std::size_t edge = 1;
    const auto depth = [&](std::size_t i) {
      const double inner = static_cast<double>(i) * spacing;
      return rings[i] / (std::numbers::pi * (2 * inner + spacing) * spacing);
    };
    while (edge < rings.size() && depth(edge) > 0.25 * scene.dx) ++edge;
    result.runout = static_cast<double>(edge) * spacing / kRadius - 1;
    std::sort(radii.begin(), radii.end());
    result.outer = radii[radii.size() * 99 / 100] / kRadius - 1;
    result.height = (top + 0.5 * spacing) / kRadius;
    return true;
  });
  return result;
}

// --- Newtonian fluid falling between two sticky walls
// ---------------------------------------------

struct Shear {
  double centre = 0.0;     ///< speed in the middle [m/s]
  double expected = 0.0;   ///< ρ g H²/(8 η)
  double wall_slip = 0.0;  ///< speed at the wall by the fitted parabola / expected speed
};

/// A long column between sticky walls H = 40 mm apart, `cells` cells across, η = 10 Pa s, slip
/// walls two cells apart across it; measured in its middle third once the flow is terminal. The
/// first wall lies `offset` cells from a node.
inline Shear channel_flow(int cells, double offset, shape::ContactMethod method, int threads = 1) {
  constexpr double kGap = 0.04;
  constexpr double kViscosity = 10.0;
  Scene scene;
  scene.dx = kGap / cells;
  const double start = offset * scene.dx;
  const double slab = 2 * scene.dx;
  const double length = 3 * kGap;
  // Sticky walls hold what has touched them.
  const double touch = 1e-3 * scene.dx;
  Body body =
      box_body("fluid", Vec3d(start, 0, 0), Vec3d(start + kGap, slab, length), 0.5 * scene.dx);
  body.formulation = Formulation::kUpdated;
  body.material.law = material::Law::kNewtonian;
  body.material.viscosity = kViscosity;
  body.material.bulk_modulus = 1e5;
  shape::Contact glue;
  glue.kind = shape::ContactKind::kGlue;
  glue.method = method;
  shape::Contact slip;
  slip.kind = shape::ContactKind::kSlip;
  scene.colliders.push_back(
      shape::make_plane("left", glue, Vec3d(start + touch, 0, 0), Vec3d::UnitX()));
  scene.colliders.push_back(
      shape::make_plane("right", glue, Vec3d(start + kGap - touch, 0, 0), -Vec3d::UnitX()));
  scene.colliders.push_back(shape::make_plane("front", slip, Vec3d::Zero(), Vec3d::UnitY()));
  scene.colliders.push_back(shape::make_plane("rear", slip, Vec3d(0, slab, 0), -Vec3d::UnitY()));
  const Points rest = body.rest;
  scene.bodies.push_back(std::move(body));
  scene.fps = 200;
  scene.end_frame = 17;  // 80 ms: five times H²/(π² ν)
  Shear result;
  result.expected = 1000.0 * kPull * kGap * kGap / (8 * kViscosity);
  run(scene, threads, [&](const FrameState& state) {
    if (state.frame != 16) return true;
    // v = a + b s², s from −1 at one wall to 1 at the other.
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (std::size_t p = 0; p < rest.size(); ++p) {
      if (rest[p][2] < length / 3 || rest[p][2] > 2 * length / 3) continue;
      const double s =
          2 * (static_cast<double>(state.bodies[0].positions[p][0]) - start) / kGap - 1;
      const Eigen::Vector2d row(1, s * s);
      normal += row * row.transpose();
      right -= row * static_cast<double>(state.bodies[0].velocities[p][2]);
    }
    const Eigen::Vector2d fit = normal.ldlt().solve(right);
    result.centre = fit[0];
    result.wall_slip = (fit[0] + fit[1]) / result.expected;
    return true;
  });
  return result;
}

}  // namespace matterfit::mpm::validation
