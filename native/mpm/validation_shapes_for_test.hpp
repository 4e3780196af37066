// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "mpm/simulation.hpp"

/// What validation tests and benchmarks share: shapes on a lattice, sums over particles, and the
/// fit of a sinusoid.
namespace matterfit::mpm::validation {

/// Lattice cells of edge `spacing` whose centre lies where `inside` says, within [low, high]; the
/// lattice starts at `low`, where a cell of the grid starts too.
inline Body lattice_body(const std::string& name, const Vec3d& low, const Vec3d& high,
                         double spacing, const std::function<bool(const Vec3d&)>& inside) {
  Body body;
  body.name = name;
  body.lattice.origin = low;
  body.lattice.spacing = spacing;
  body.lattice.regular = true;
  const Vec3d counts = ((high - low) / spacing).array().round();
  for (int i = 0; i < counts[0]; ++i) {
    for (int j = 0; j < counts[1]; ++j) {
      for (int k = 0; k < counts[2]; ++k) {
        const Vec3d x = low + spacing * Vec3d(i + 0.5, j + 0.5, k + 0.5);
        if (inside(x)) body.rest.push_back(x);
      }
    }
  }
  body.volumes.assign(body.rest.size(), spacing * spacing * spacing);
  return body;
}

inline Body box_body(const std::string& name, const Vec3d& low, const Vec3d& high, double spacing) {
  return lattice_body(name, low, high, spacing, [](const Vec3d&) { return true; });
}

inline Body ball_body(const std::string& name, const Vec3d& centre, double radius, double spacing) {
  const Vec3d half = Vec3d::Constant(radius);
  return lattice_body(name, centre - half, centre + half, spacing,
                      [&](const Vec3d& x) { return (x - centre).norm() < radius; });
}

inline Vec3d mean(const std::vector<Vec3f>& values) {
  Vec3d sum = Vec3d::Zero();
  for (const Vec3f& v : values) sum += v.cast<double>();
  return sum / static_cast<double>(values.size());
}

/// Mean of the values of the particles for which `chosen` holds at rest.
inline Vec3d mean_where(const std::vector<Vec3f>& values, const Points& rest,
                        const std::function<bool(const Vec3d&)>& chosen) {
  Vec3d sum = Vec3d::Zero();
  double count = 0;
  for (std::size_t p = 0; p < values.size(); ++p) {
    if (!chosen(rest[p])) continue;
    sum += values[p].cast<double>();
    count += 1;
  }
  return sum / count;
}

/// Runs the scene to its end; `watch` sees every frame, the first included.
inline void run(const Scene& scene, int threads,
                const std::function<bool(const FrameState&)>& watch) {
  Simulation simulation(scene, std::make_shared<Arena>(threads));
  const Interrupter interrupter;
  for (bool go_on = watch(simulation.state()); go_on && simulation.frame() + 1 < scene.end_frame;) {
    simulation.advance(interrupter);
    go_on = watch(simulation.state());
  }
}

struct Sinusoid {
  double centre = 0.0;
  double amplitude = 0.0;
  double frequency = 0.0;  ///< [Hz]
  double damping = 0.0;    ///< ζ
  double residual = 0.0;   ///< root mean square
};

/// Least squares c + e^(−ζωt)(a cos ωt + b sin ωt): a scan around `expected` [Hz], refined; the
/// linear coefficients are solved for.
inline Sinusoid fit_sinusoid(const std::vector<double>& times, const std::vector<double>& values,
                             double expected) {
  const auto rows = static_cast<Eigen::Index>(times.size());
  const auto evaluate = [&](double frequency, double damping) {
    Eigen::MatrixXd a(rows, 3);
    Eigen::VectorXd y(rows);
    const double omega = 2.0 * std::numbers::pi * frequency;
    for (Eigen::Index i = 0; i < rows; ++i) {
      const double t = times[static_cast<std::size_t>(i)] - times.front();
      const double decay = std::exp(-damping * omega * t);
      a.row(i) << 1.0, decay * std::cos(omega * t), decay * std::sin(omega * t);
      y[i] = values[static_cast<std::size_t>(i)];
    }
    const Eigen::Vector3d c = (a.transpose() * a).ldlt().solve(a.transpose() * y);
    Sinusoid fit;
    fit.centre = c[0];
    fit.amplitude = std::hypot(c[1], c[2]);
    fit.frequency = frequency;
    fit.damping = damping;
    fit.residual = std::sqrt((a * c - y).squaredNorm() / static_cast<double>(rows));
    return fit;
  };
  Sinusoid best = evaluate(expected, 0.0);
  const auto try_at = [&](double frequency, double damping) {
    const Sinusoid other = evaluate(frequency, damping);
    if (other.residual < best.residual) best = other;
  };
  for (int i = -60; i <= 60; ++i) try_at(expected * std::pow(1.01, i), 0.0);
  double step_f = 0.01 * expected;
  double step_d = 0.01;
  for (int round = 0; round < 60; ++round) {
    const Sinusoid before = best;
    for (const int s : {-1, 1}) {
      try_at(before.frequency + s * step_f, best.damping);
      try_at(best.frequency, before.damping + s * step_d);
    }
    if (best.residual >= before.residual) {
      step_f *= 0.5;
      step_d *= 0.5;
    }
  }
  return best;
}

/// Largest minus smallest.
inline double spread(const std::vector<double>& values) {
  double low = values.front();
  double high = values.front();
  for (const double v : values) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
  return high - low;
}

inline double average(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

}  // namespace matterfit::mpm::validation
