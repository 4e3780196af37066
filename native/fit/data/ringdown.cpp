// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/ringdown.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using std::numbers::pi;

constexpr std::size_t kFewestSamples = 16;
constexpr double kFewestPeriods = 2.0;
constexpr double kExplained = 0.5;
constexpr double kMostDamped = 0.5;  // a motion that dies within a period creeps, it does not ring

struct Signal {
  VectorXd tau;
  VectorXd value;
  [[nodiscard]] double length() const { return tau[tau.size() - 1] - tau[0]; }
};

/// The parameters that enter nonlinearly.
struct Shape {
  double omega = 0.0;
  double sigma = 0.0;
  double drift_time = 1.0;
};

MatrixXd basis(const Signal& signal, const Shape& shape) {
  MatrixXd columns(signal.tau.size(), 4);
  for (Eigen::Index i = 0; i < signal.tau.size(); ++i) {
    const double t = signal.tau[i];
    const double decay = std::exp(-shape.sigma * t);
    columns(i, 0) = 1.0;
    columns(i, 1) = std::exp(-t / shape.drift_time);
    columns(i, 2) = decay * std::cos(shape.omega * t);
    columns(i, 3) = decay * std::sin(shape.omega * t);
  }
  return columns;
}

/// Linear coefficients for a shape, and the sum of squares that is left.
double project(const Signal& signal, const Shape& shape, Eigen::Vector4d* coefficients) {
  const MatrixXd columns = basis(signal, shape);
  Eigen::Matrix4d normal = columns.transpose() * columns;
  // A touch of damping keeps a drift that cannot be told from the constant from growing huge.
  normal.diagonal() *= 1.0 + 1e-12;
  const Eigen::Vector4d solution = normal.ldlt().solve(columns.transpose() * signal.value);
  if (coefficients != nullptr) *coefficients = solution;
  return (signal.value - columns * solution).squaredNorm();
}

Shape scan(const Signal& signal, double spacing) {
  constexpr std::size_t kMostFrequencies = 2000;
  const double length = signal.length();
  const double lowest = kFewestPeriods / length;
  const double highest = 0.45 / spacing;
  const double step = std::max(0.25 / length, (highest - lowest) / double(kMostFrequencies));
  Shape best;
  double least = -1.0;
  for (double f = lowest; f <= highest; f += step) {
    for (const double ratio : {0.0, 0.02, 0.08, 0.25}) {
      Shape shape;
      shape.omega = 2.0 * pi * f;
      shape.sigma = ratio * shape.omega;
      shape.drift_time = length / 4.0;
      const double left = project(signal, shape, nullptr);
      if (least < 0.0 || left < least) {
        least = left;
        best = shape;
      }
    }
  }
  return best;
}

/// Levenberg–Marquardt on the variable projection functional; three unknowns, numerical Jacobian of
/// the projected residual.
Shape refine(const Signal& signal, Shape shape) {
  const double length = signal.length();
  const double omega_start = shape.omega;
  const auto unpack = [&](const Eigen::Vector3d& q) {
    Shape s;
    s.omega = omega_start * std::exp(q[0]);
    s.sigma = q[1] * omega_start;
    const double shortest = 2.0 * pi / s.omega;
    s.drift_time = std::clamp(std::exp(q[2]), std::min(shortest, length), length);
    return s;
  };
  const auto residual = [&](const Eigen::Vector3d& q) -> VectorXd {
    const Shape s = unpack(q);
    Eigen::Vector4d c;
    project(signal, s, &c);
    return signal.value - basis(signal, s) * c;
  };
  Eigen::Vector3d q(0.0, shape.sigma / omega_start, std::log(shape.drift_time));
  VectorXd r = residual(q);
  double lambda = 1e-3;
  for (int iteration = 0; iteration < 100; ++iteration) {
    MatrixXd jacobian(r.size(), 3);
    const Eigen::Vector3d steps(1e-6, 1e-6, 1e-4);
    for (int k = 0; k < 3; ++k) {
      Eigen::Vector3d ahead = q;
      Eigen::Vector3d behind = q;
      ahead[k] += steps[k];
      behind[k] -= steps[k];
      jacobian.col(k) = (residual(ahead) - residual(behind)) / (2.0 * steps[k]);
    }
    const Eigen::Matrix3d normal = jacobian.transpose() * jacobian;
    const Eigen::Vector3d gradient = jacobian.transpose() * r;
    bool moved = false;
    for (int attempt = 0; attempt < 12 && !moved; ++attempt) {
      Eigen::Matrix3d damped = normal;
      damped.diagonal() += lambda * normal.diagonal().cwiseMax(1e-12 * normal.trace() + 1e-300);
      const Eigen::Vector3d step = -damped.ldlt().solve(gradient);
      const Eigen::Vector3d trial = q + step;
      const bool sane = step.allFinite() && std::abs(trial[0]) < 1.0 && std::abs(trial[1]) < 2.0;
      const VectorXd trial_residual = sane ? residual(trial) : VectorXd();
      if (sane && trial_residual.squaredNorm() < r.squaredNorm()) {
        const double gain = 1.0 - trial_residual.squaredNorm() / r.squaredNorm();
        q = trial;
        r = trial_residual;
        lambda = std::max(1e-12, lambda * 0.2);
        moved = true;
        if (gain < 1e-14) return unpack(q);
      } else {
        lambda *= 5.0;
      }
    }
    if (!moved) break;
  }
  return unpack(q);
}

}  // namespace

std::optional<Ringdown> fit_ringdown(std::span<const double> times,
                                     std::span<const Vec3d> positions, double release) {
  if (times.size() != positions.size()) {
    throw_input("ring-down: " + std::to_string(times.size()) + " times for " +
                std::to_string(positions.size()) + " positions.");
  }
  Vec3d quiet = Vec3d::Zero();
  std::size_t quiet_count = 0;
  std::vector<std::size_t> after;
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!positions[i].allFinite()) continue;
    if (times[i] <= release) {
      quiet += positions[i];
      ++quiet_count;
    } else {
      after.push_back(i);
    }
  }
  if (after.size() < kFewestSamples) return std::nullopt;
  quiet = quiet_count > 0 ? Vec3d(quiet / double(quiet_count)) : positions[after.front()];

  Vec3d mean = Vec3d::Zero();
  for (const std::size_t i : after) mean += positions[i] - quiet;
  mean /= double(after.size());
  Mat3d covariance = Mat3d::Zero();
  for (const std::size_t i : after) {
    const Vec3d d = positions[i] - quiet - mean;
    covariance += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(covariance);
  Vec3d direction = eigen.eigenvectors().col(2);
  if (!(eigen.eigenvalues()[2] > 0.0)) return std::nullopt;
  if (direction.dot(mean) < 0.0) direction = -direction;

  Signal signal;
  const auto count = static_cast<Eigen::Index>(after.size());
  signal.tau.resize(count);
  signal.value.resize(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const std::size_t i = after[static_cast<std::size_t>(k)];
    signal.tau[k] = times[i] - release;
    signal.value[k] = direction.dot(positions[i] - quiet);
  }
  const double spacing = signal.length() / double(count - 1);
  if (!(spacing > 0.0)) return std::nullopt;

  const Shape shape = refine(signal, scan(signal, spacing));
  Eigen::Vector4d c;
  const double left = project(signal, shape, &c);
  const MatrixXd drift = basis(signal, shape).leftCols(2);
  const VectorXd drift_only = drift.colPivHouseholderQr().solve(signal.value);
  const double without = (signal.value - drift * drift_only).squaredNorm();
  const double periods = shape.omega * signal.length() / (2.0 * pi);
  const bool rings = left < (1.0 - kExplained) * without && periods >= kFewestPeriods &&
                     std::abs(shape.sigma) < kMostDamped * shape.omega;
  if (!rings) return std::nullopt;

  Ringdown ring;
  const double end = signal.tau[count - 1];
  ring.drop_m = c[0] + c[1] * std::exp(-end / shape.drift_time);
  ring.frequency_hz = shape.omega / (2.0 * pi);
  ring.damping_ratio = shape.sigma / std::hypot(shape.sigma, shape.omega);
  ring.amplitude_m = std::hypot(c[2], c[3]);
  ring.drift_m = c[1];
  ring.drift_time_s = shape.drift_time;
  ring.residual_m = std::sqrt(left / double(count));
  ring.direction = direction;
  if (ring.drop_m < 0.0) {
    ring.drop_m = -ring.drop_m;
    ring.drift_m = -ring.drift_m;
    ring.direction = -ring.direction;
  }
  return ring;
}

}  // namespace matterfit::fit
