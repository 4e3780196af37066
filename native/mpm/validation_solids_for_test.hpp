// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

#include "mpm/validation_shapes_for_test.hpp"

/// Solid bodies with a known answer. Each function runs one case and returns what it measured.
namespace matterfit::mpm::validation {

inline constexpr double kGravity = 9.81;

// --- An elastic ball on a floor
// -------------------------------------------------------------------

struct DropSetting {
  Formulation formulation = Formulation::kTotal;
  shape::ContactMethod method = shape::ContactMethod::kParticle;
  int cells = 8;         ///< across the ball
  double offset = 0.0;   ///< of the floor against the grid's nodes, in cells
  double damping = -1;   ///< of the contact; negative: the solver's default
  double stiffness = 0;  ///< of the contact; 0: the solver's default
  bool settle = false;   ///< start in touch, with a damped material, and come to rest
  int threads = 1;
};

struct Drop {
  double rebound = 0.0;  ///< height of the centre of mass after the bounce / height dropped
  double deepest = 0.0;  ///< lowest height of the centre of mass above the floor [m]
  double rest = 0.0;     ///< the same at the end (settle)
};

/// E 5e4 Pa, ρ 1000, ν .3, 80 mm across, dropped by half its diameter.
inline Drop drop_ball(const DropSetting& setting) {
  constexpr double kDiameter = 0.08;
  Scene scene;
  scene.dx = kDiameter / setting.cells;
  scene.fps = 250;
  const double fall = setting.settle ? 0.0 : 0.5 * kDiameter;
  // Updated: floor and body move together against the world's grid. Total: the grid in the body.
  const bool total = setting.formulation == Formulation::kTotal;
  const double floor = total ? 0.0 : setting.offset * scene.dx;
  if (total) scene.grid_shift = Vec3d(0, 0, setting.offset);
  Body body = ball_body("ball", Vec3d(0, 0, floor + fall + 0.5 * kDiameter), 0.5 * kDiameter,
                        0.5 * scene.dx);
  body.formulation = setting.formulation;
  body.material.law = material::Law::kFixedCorotated;
  body.material.youngs_modulus = 5e4;
  body.material.poisson_ratio = 0.3;
  if (setting.settle) body.material.damping_shear = 20.0;
  scene.bodies.push_back(std::move(body));
  shape::Contact contact;
  contact.kind = shape::ContactKind::kSeparating;
  contact.damping = setting.settle ? 0.3 : setting.damping;
  contact.stiffness = setting.stiffness;
  contact.method = setting.method;
  scene.colliders.push_back(
      shape::make_plane("floor", contact, Vec3d(0, 0, floor), Vec3d::UnitZ()));
  scene.end_frame = setting.settle ? 150 : 200;

  Drop result;
  double z_before = 0.0;
  double v_before = 0.0;
  double deepest = 1e30;
  double seconds = 1.0 / scene.fps;
  bool rising = false;
  run(scene, setting.threads, [&](const FrameState& state) {
    const double z = mean(state.bodies[0].positions)[2] - floor;
    const double v = mean(state.bodies[0].velocities)[2];
    if (state.frame > 0 && v_before < 0.0 && v >= 0.0) {
      // The cubic through both ends with their slopes, at its lowest.
      for (int i = 0; i <= 100; ++i) {
        const double s = i / 100.0;
        const double h = (2 * s * s * s - 3 * s * s + 1) * z_before +
                         (s * s * s - 2 * s * s + s) * seconds * v_before +
                         (3 * s * s - 2 * s * s * s) * z + (s * s * s - s * s) * seconds * v;
        deepest = std::min(deepest, h);
      }
      rising = true;
    }
    z_before = z;
    v_before = v;
    result.rest = z;
    if (setting.settle || !rising || v >= 0.0) return true;
    result.rebound = (z + v * v / (2 * kGravity) - 0.5 * kDiameter) / fall;
    return false;
  });
  result.deepest = deepest;
  return result;
}

// --- A block on an incline
// ------------------------------------------------------------------------

struct Slide {
  double acceleration = 0.0;  ///< along the incline [m/s²], from 0.4 s on
  double expected = 0.0;      ///< Coulomb's law
  double creep_early = 0.0;   ///< displacement from 0.4 s to 0.7 s [m]
  double creep_late = 0.0;    ///< displacement from 0.7 s to 1.0 s [m]
};

/// `steepness`: tan θ / μ; the floor lies `offset` cells above a node.
inline Slide slide_block(Formulation formulation, double steepness, double offset, int cells = 4,
                         int threads = 1,
                         shape::ContactMethod method = shape::ContactMethod::kParticle) {
  constexpr double kMu = 0.5;
  constexpr double kEdge = 0.08;
  Scene scene;
  scene.dx = kEdge / cells;
  scene.fps = 50;
  scene.end_frame = 51;
  const double angle = std::atan(steepness * kMu);
  scene.gravity = shape::Keyed<Vec3d>(kGravity * Vec3d(std::sin(angle), 0, -std::cos(angle)));
  const bool total = formulation == Formulation::kTotal;
  const double floor = total ? 0.0 : offset * scene.dx;
  if (total) scene.grid_shift = Vec3d(0, 0, offset);
  Body body = box_body("block", Vec3d(0, 0, floor), Vec3d(kEdge, kEdge, floor + 0.5 * kEdge),
                       0.5 * scene.dx);
  body.formulation = formulation;
  body.material.youngs_modulus = 1e5;
  body.material.damping_shear = 10.0;
  scene.bodies.push_back(std::move(body));
  shape::Contact contact;
  contact.kind = shape::ContactKind::kFriction;
  contact.mu = kMu;
  contact.damping = 0.3;
  contact.method = method;
  scene.colliders.push_back(
      shape::make_plane("incline", contact, Vec3d(0, 0, floor), Vec3d::UnitZ()));
  Slide result;
  result.expected = kGravity * (std::sin(angle) - kMu * std::cos(angle));
  std::vector<double> x;
  std::vector<double> v;
  run(scene, threads, [&](const FrameState& state) {
    x.push_back(mean(state.bodies[0].positions)[0]);
    v.push_back(mean(state.bodies[0].velocities)[0]);
    return true;
  });
  result.acceleration = (v[50] - v[20]) / 0.6;
  result.creep_early = x[35] - x[20];
  result.creep_late = x[50] - x[35];
  return result;
}

// --- Bars and beams
// -------------------------------------------------------------------------------

struct BarSetting {
  Formulation formulation = Formulation::kTotal;
  bool clamped = true;  ///< one end on a plane pin; else both ends free
  int cells = 4;        ///< across
  double offset = 0.0;  ///< of the clamp against the grid, in cells
  int threads = 1;
};

struct Frequency {
  double measured = 0.0;
  double expected = 0.0;
  double damping = 0.0;
};

/// Longitudinal vibration of a bar of E 1e5, ν 0, ρ 1000, .2 × .04 × .04 m, by its first mode:
/// c/4L clamped, c/2L free, c = √(E/ρ).
inline Frequency bar_frequency(const BarSetting& setting) {
  constexpr double kLength = 0.2;
  constexpr double kWidth = 0.04;
  constexpr double kSpeed = 0.02;
  Scene scene;
  scene.dx = kWidth / setting.cells;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  Body body = box_body("bar", Vec3d::Zero(), Vec3d(kLength, kWidth, kWidth), 0.5 * scene.dx);
  body.formulation = setting.formulation;
  body.material.youngs_modulus = 1e5;
  body.material.poisson_ratio = 0.0;
  if (setting.formulation == Formulation::kTotal) {
    scene.grid_shift = Vec3d(setting.offset, 0, 0);
  } else {
    const Vec3d shift(setting.offset * scene.dx, 0, 0);
    for (Vec3d& x : body.rest) x += shift;
    body.lattice.origin += shift;
  }
  const double start = setting.formulation == Formulation::kTotal ? 0.0 : setting.offset * scene.dx;
  for (const Vec3d& x : body.rest) {
    const double s = std::numbers::pi * (x[0] - start) / kLength;
    body.particle_velocities.emplace_back(
        kSpeed * (setting.clamped ? std::sin(0.5 * s) : std::cos(s)), 0, 0);
  }
  if (setting.clamped) {
    Pin pin;
    pin.region = Pin::Region::kPlane;
    pin.point = Vec3d(start, 0, 0);
    pin.normal = Vec3d::UnitX();
    body.pins.push_back(pin);
  }
  Frequency result;
  result.expected = std::sqrt(1e5 / 1000.0) / ((setting.clamped ? 4 : 2) * kLength);
  scene.fps = 40 * result.expected;
  scene.end_frame = 121;  // three periods
  const Points rest = body.rest;
  scene.bodies.push_back(std::move(body));
  std::vector<double> times;
  std::vector<double> tip;
  run(scene, setting.threads, [&](const FrameState& state) {
    times.push_back(state.time);
    const auto end = [&](const Vec3d& x) { return x[0] > start + kLength - scene.dx; };
    const auto other = [&](const Vec3d& x) { return x[0] < start + scene.dx; };
    double x = mean_where(state.bodies[0].positions, rest, end)[0];
    if (!setting.clamped) x -= mean_where(state.bodies[0].positions, rest, other)[0];
    tip.push_back(x);
    return true;
  });
  const Sinusoid fit = fit_sinusoid(times, tip, result.expected);
  result.measured = fit.frequency;
  result.damping = fit.damping;
  return result;
}

/// A cantilever of square section by Timoshenko's theory (Cowper's shear coefficient).
struct Timoshenko {
  double length, thickness, youngs_modulus, poisson_ratio, density;
  [[nodiscard]] double shear_stiffness() const {  ///< κGA per area
    const double kappa = 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio);
    return kappa * youngs_modulus / (2 * (1 + poisson_ratio));
  }
  /// The deflection of the tip under the beam's own weight [m].
  [[nodiscard]] double sag() const {
    const double load = density * kGravity;  // per volume
    const double inertia = thickness * thickness / 12;
    return load * std::pow(length, 4) / (8 * youngs_modulus * inertia) +
           load * length * length / (2 * shear_stiffness());
  }
  /// Moment and shear force at the tip for the two solutions that are clamped at the root; zero at
  /// an eigenfrequency. State: deflection, rotation, curvature M/EI, shear strain V/κGA.
  [[nodiscard]] double characteristic(double hertz) const {
    const double omega2 = std::pow(2 * std::numbers::pi * hertz, 2);
    const double inertia = thickness * thickness / 12;
    const double ei = youngs_modulus * inertia;
    const double kga = shear_stiffness();
    const auto slope = [&](const Eigen::Vector4d& s) -> Eigen::Vector4d {
      return {s[1] + s[3] / kga, s[2] / ei, -density * inertia * omega2 * s[1] - s[3],
              -density * omega2 * s[0]};
    };
    constexpr int kSteps = 400;
    const double h = length / kSteps;
    Eigen::Matrix2d end;
    for (int c = 0; c < 2; ++c) {
      Eigen::Vector4d s = c == 0 ? Eigen::Vector4d(0, 0, ei / length, 0)
                                 : Eigen::Vector4d(0, 0, 0, ei / length / length);
      for (int i = 0; i < kSteps; ++i) {
        const Eigen::Vector4d k1 = slope(s);
        const Eigen::Vector4d k2 = slope(s + 0.5 * h * k1);
        const Eigen::Vector4d k3 = slope(s + 0.5 * h * k2);
        const Eigen::Vector4d k4 = slope(s + h * k3);
        s += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      }
      end.col(c) = s.tail<2>();
    }
    return end.determinant();
  }
  /// First bending frequency [Hz].
  [[nodiscard]] double frequency() const {
    const double slender = 0.5596 * std::sqrt(youngs_modulus / density) * thickness /
                           std::sqrt(12.0) / (length * length);
    double low = 0.5 * slender;
    double high = 1.05 * slender;
    const bool sign = characteristic(low) > 0;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (low + high);
      ((characteristic(middle) > 0) == sign ? low : high) = middle;
    }
    return low;
  }
};

struct Cantilever {
  double sag = 0.0;  ///< centre of the tip's ring [m]
  double frequency = 0.0;
  double damping = 0.0;
};

inline constexpr Timoshenko kBeam{0.12, 0.02, 2e6, 0.3, 1000.0};

/// kBeam released under its own weight, two periods; `offset` moves the clamp in the cell.
inline Cantilever cantilever(const BarSetting& setting) {
  Scene scene;
  scene.dx = kBeam.thickness / setting.cells;
  const bool total = setting.formulation == Formulation::kTotal;
  const double start = total ? 0.0 : setting.offset * scene.dx;
  if (total) scene.grid_shift = Vec3d(setting.offset, 0, 0);
  Body body =
      box_body("beam", Vec3d(start, 0, 0),
               Vec3d(start + kBeam.length, kBeam.thickness, kBeam.thickness), 0.5 * scene.dx);
  body.formulation = setting.formulation;
  body.density = kBeam.density;
  body.material.youngs_modulus = kBeam.youngs_modulus;
  body.material.poisson_ratio = kBeam.poisson_ratio;
  Pin pin;
  pin.region = Pin::Region::kPlane;
  pin.point = Vec3d(start, 0, 0);
  pin.normal = Vec3d::UnitX();
  body.pins.push_back(pin);
  const double expected = kBeam.frequency();
  scene.fps = 30 * expected;
  scene.end_frame = 61;
  const Points rest = body.rest;
  scene.bodies.push_back(std::move(body));
  std::vector<double> times;
  std::vector<double> tip;
  run(scene, setting.threads, [&](const FrameState& state) {
    times.push_back(state.time);
    // The outermost two layers' mean, extrapolated to the end face by their difference.
    const auto layer = [&](int n) {
      const double low = start + kBeam.length - (n + 1) * 0.5 * scene.dx;
      return mean_where(state.bodies[0].positions, rest, [&](const Vec3d& x) {
        return x[0] > low && x[0] < low + 0.5 * scene.dx;
      })[2];
    };
    tip.push_back(1.5 * layer(0) - 0.5 * layer(1));
    return true;
  });
  const Sinusoid fit = fit_sinusoid(times, tip, expected);
  return {tip.front() - fit.centre, fit.frequency, fit.damping};
}

}  // namespace matterfit::mpm::validation
