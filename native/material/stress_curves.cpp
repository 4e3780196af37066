// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/stress_curves.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "base/error.hpp"
#include "base/parallel.hpp"
#include "material/classical/point_law.hpp"
#include "material/correction.hpp"
#include "material/neural/published_law.hpp"
#include "material/neural/published_material.hpp"

namespace matterfit::material {
namespace {

constexpr int kNewtonSteps = 60;
/// Stress on a free side, by the law's stiffness, that counts as none.
constexpr double kNoStress = 1e-9;
/// The same where Newton's method comes to rest: the kinks of a flow.
constexpr double kHardlyStress = 1e-5;
constexpr double kSideDifference = 1e-6;
/// Steps of |dev ε|: flows are solved implicitly, and are smooth in steps of this size.
constexpr double kCurveStep = 2e-3;

/// Kirchhoff stress after F ← step F, carrying the state along.
using Advance = std::function<Mat3d(const Mat3d& step, PointState& state)>;

/// Hencky strains of the axes that are driven and γ, as functions of where a pull is.
struct Drive {
  Pull pull;
  [[nodiscard]] std::size_t free_sides() const {
    return pull == Pull::kUniaxial ? 2 : pull == Pull::kEquibiaxial ? 1 : 0;
  }
  /// The step from one place to the next with the logarithms of the free sides' stretches.
  [[nodiscard]] Mat3d step(double from, double to, const Vec3d& sides) const {
    if (pull == Pull::kShear) {
      Mat3d shear = Mat3d::Identity();
      shear(0, 1) = to - from;
      return shear;
    }
    const double along = to / from;
    return Vec3d(along, pull == Pull::kEquibiaxial ? along : std::exp(sides.y()),
                 std::exp(sides.z()))
        .asDiagonal();
  }
};

/// Stretches the free sides of one step so that they are free; `sides` begins as a guess and ends
/// as what was found. Only y and z, or z.
class FreeSides {
 public:
  FreeSides(const Drive& drive, const Advance& advance, double modulus)
      : drive_(drive), advance_(advance), modulus_(modulus), count_(drive.free_sides()) {}

  Mat3d take(double from, double to, Vec3d& sides, PointState& state, Mat3d& step) const {
    Mat3d tau;
    PointState next = state;
    const auto residual = [&](const Vec3d& at) {
      next = state;
      step = drive_.step(from, to, at);
      tau = advance_(step, next);
      Eigen::VectorXd on(count_);
      for (Eigen::Index i = 0; i < count_; ++i) on[i] = tau(3 - count_ + i, 3 - count_ + i);
      return on;
    };
    Eigen::VectorXd on = residual(sides);
    double damping = 0.0;
    for (int k = 0; k < kNewtonSteps && count_ > 0 && on.norm() > kNoStress * modulus_; ++k) {
      Eigen::MatrixXd jacobian(count_, count_);
      for (Eigen::Index i = 0; i < count_; ++i) {
        Vec3d moved = sides;
        moved[3 - count_ + i] += kSideDifference;
        jacobian.col(i) = (residual(moved) - on) / kSideDifference;
      }
      Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
      const Eigen::VectorXd slope = jacobian.transpose() * on;
      bool better = false;
      for (int t = 0; t < 30 && !better; ++t) {
        Eigen::MatrixXd damped = normal;
        damped.diagonal().array() += (damping + 1e-14) * modulus_ * modulus_;
        const Eigen::VectorXd move = damped.ldlt().solve(slope);
        Vec3d trial = sides;
        for (Eigen::Index i = 0; i < count_; ++i) {
          trial[3 - count_ + i] -= std::clamp(move[i], -0.1, 0.1);
        }
        const Eigen::VectorXd there = residual(trial);
        better = there.allFinite() && there.norm() < on.norm();
        if (better) {
          sides = trial;
          on = there;
          damping *= 0.1;
        } else {
          damping = std::max(4.0 * damping, 1e-8);
        }
      }
      if (!better) break;
    }
    on = residual(sides);
    if (!(on.norm() <= kHardlyStress * modulus_)) {
      throw_compute(
          fmt::format("{} from {:.4g} to {:.4g}: no stretch of the free sides takes the "
                      "stress from them. Ask for smaller strains.",
                      pull_name(drive_.pull), from, to));
    }
    state = next;
    return tau;
  }

 private:
  Drive drive_;
  const Advance& advance_;
  double modulus_;
  Eigen::Index count_;
};

/// How a step of so long is taken [s].
using AdvanceOver = std::function<Advance(double dt)>;
/// Into how many steps of a stretch of |dev ε| a section is to be divided at a rate.
using StepsOf = std::function<std::size_t(double strain, double rate)>;

std::vector<CurvePoint> follow_pull(Pull pull, std::span<const double> stops, double rate,
                                    double modulus, const AdvanceOver& over,
                                    const StepsOf& steps_of) {
  const Drive drive{pull};
  const bool shear = pull == Pull::kShear;
  if (!(rate > 0.0) || !std::isfinite(rate)) {
    throw_input(fmt::format("the rate of a stress curve is {}, expected above 0 1/s.", rate));
  }
  for (const double stop : stops) {
    if (!std::isfinite(stop) || (!shear && stop <= 0.0)) {
      throw_input(fmt::format("a stress curve asks for the stretch {}, expected above 0.", stop));
    }
  }
  std::vector<CurvePoint> curve;
  PointState state;
  Mat3d f = Mat3d::Identity();
  double at = shear ? 0.0 : 1.0;
  Vec3d sides = Vec3d::Zero();
  for (const double stop : stops) {
    const double strain = std::abs(pull_strain(pull, stop) - pull_strain(pull, at));
    Mat3d tau = Mat3d::Zero();
    if (strain > 0.0) {
      const std::size_t steps = steps_of(strain, rate);
      const Advance advance = over(strain / rate / double(steps));
      const FreeSides free(drive, advance, modulus);
      const double from = at;
      if (!shear) {  // a guess that preserves volume
        const double along = std::log(stop / at) / double(steps);
        sides = pull == Pull::kUniaxial ? Vec3d(0.0, -0.5 * along, -0.5 * along)
                                        : Vec3d(0.0, 0.0, -2.0 * along);
      }
      for (std::size_t i = 0; i < steps; ++i) {
        const double part = double(i + 1) / double(steps);
        const double next =
            shear ? from + (stop - from) * part : from * std::pow(stop / from, part);
        Mat3d step;
        tau = free.take(at, next, sides, state, step);
        f = step * f;
        at = next;
      }
    } else if (!curve.empty()) {
      CurvePoint again = curve.back();
      curve.push_back(again);
      continue;
    }
    const Mat3d nominal = tau * f.inverse().transpose();
    const int other = shear ? 1 : 0;
    curve.push_back({stop, nominal(0, other), tau(0, other) / f.determinant(), f(2, 2)});
  }
  return curve;
}

}  // namespace

std::string_view pull_name(Pull pull) {
  switch (pull) {
    case Pull::kUniaxial:
      return "uniaxial";
    case Pull::kEquibiaxial:
      return "equibiaxial";
    case Pull::kShear:
      break;
  }
  return "shear";
}

double pull_at(Pull pull, double strain) {
  switch (pull) {
    case Pull::kUniaxial:
      return std::exp(strain * std::sqrt(2.0 / 3.0));
    case Pull::kEquibiaxial:
      return std::exp(strain / std::sqrt(6.0));
    case Pull::kShear:
      break;
  }
  return 2.0 * std::sinh(strain / std::numbers::sqrt2);
}

double pull_strain(Pull pull, double by) {
  switch (pull) {
    case Pull::kUniaxial:
      return std::sqrt(1.5) * std::log(by);
    case Pull::kEquibiaxial:
      return std::sqrt(6.0) * std::log(by);
    case Pull::kShear:
      break;
  }
  return std::numbers::sqrt2 * std::asinh(0.5 * by);
}

std::vector<CurvePoint> stress_curve(const Material& material, Pull pull,
                                     std::span<const double> stops, double rate) {
  if (material.published) return stress_curve(material.published->weights, pull, stops, rate);
  return stress_curve(material, pull, stops, rate, FurtherStress());
}

std::vector<CurvePoint> stress_curve(const Material& material, Pull pull,
                                     std::span<const double> stops, double rate,
                                     const FurtherStress& further) {
  if (material.published) throw_input("nothing acts beside the published law in a stress curve.");
  const Correction correction(material);
  const bool corrected = !correction.neutral();
  const AdvanceOver over = [&](double dt) -> Advance {
    return [law = PointLaw(material, dt), &correction, &further, corrected](const Mat3d& step,
                                                                            PointState& state) {
      Mat3d tau = law.advance(step, state);
      if (corrected) tau += correction.stress(state.elastic);
      if (further) tau += further(state.elastic);
      return tau;
    };
  };
  const StepsOf steps = [](double strain, double) {
    return static_cast<std::size_t>(std::max(1.0, std::ceil(strain / kCurveStep)));
  };
  return follow_pull(pull, stops, rate, material.p_wave_modulus(), over, steps);
}

std::vector<CurvePoint> stress_curve(const PublishedWeights& weights, Pull pull,
                                     std::span<const double> stops, double rate) {
  Arena arena(1);
  const Advance advance = [&](const Mat3d& step, PointState& state) {
    using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const Rows trial = step * state.elastic;
    Rows elastic;
    Rows tau;
    published_forward<double>(weights, GeluMode::kExact, {trial.data(), 9}, {elastic.data(), 9},
                              {tau.data(), 9}, arena);
    state.elastic = elastic;
    return Mat3d(tau);
  };
  PointState rest;
  constexpr double kSmall = 1e-3;
  const Mat3d pressed = (1.0 + kSmall) * Mat3d::Identity();
  const double modulus = advance(pressed, rest).norm() / kSmall;
  std::size_t left = kMostPublishedSubsteps;
  const StepsOf steps = [&](double strain, double at) {
    const double wanted = std::ceil(strain / (at * kPublishedSubstep) - 1e-9);
    if (!(wanted <= double(left))) {
      throw_input(fmt::format(
          "at {:.3g} 1/s the published law would take more than {} substeps to these strains. Ask "
          "for a higher rate.",
          at, kMostPublishedSubsteps));
    }
    left -= static_cast<std::size_t>(wanted);
    return std::max<std::size_t>(1, static_cast<std::size_t>(wanted));
  };
  return follow_pull(
      pull, stops, rate, modulus, [&](double) { return advance; }, steps);
}

}  // namespace matterfit::material
