// SPDX-License-Identifier: GPL-3.0-or-later
// Maxwell branches against the linear solid's closed forms, and their two formulations against each
// other at large strain.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/vec.hpp"
#include "material/classical/law_at-inl.hpp"
#include "material/classical/maxwell-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

using material::law_constants;
using material::LawConstants;
using material::Material;

constexpr double kModulus = 1e4;

Material branch(double time) {
  Material m;
  m.maxwell = {{kModulus, time}};
  return m;
}

/// A total Lagrangian point with one branch.
template <class S>
struct TotalPoint {
  LawConstants<S> c;
  S history[12] = {};
  explicit TotalPoint(double time) : c(law_constants<S>(branch(time))) {}
  Sym3<S> advance(const Mat3d& f, double dt) {
    const Mat3<S> h = to_mat3<S>(f - Mat3d::Identity());
    MaxwellStep<S> steps[material::kMostMaxwellBranches];
    maxwell_steps(c, static_cast<S>(dt), steps);
    Sym3<S> tau{};
    add_maxwell_stress<S>(c, steps, h, determinant_minus_one(h), true, history, 1, tau);
    return tau;
  }
};

Mat3d shear(double gamma) {
  Mat3d f = Mat3d::Identity();
  f(0, 1) = gamma;
  return f;
}

/// Shear, stretch, change of volume and rotation at once.
Mat3d motion(double t) {
  Mat3d f = shear(0.8 * std::sin(3.0 * t));
  f(0, 0) += 0.3 * std::sin(2.0 * t);
  f(2, 2) += 0.2 * (1.0 - std::cos(5.0 * t));
  f(2, 0) += 0.4 * t;
  return Eigen::AngleAxisd(2.0 * t, Vec3d(1, 2, 3).normalized()) * f;
}

TEST(Maxwell, AHeldShearRelaxesExponentially) {
  constexpr double kTime = 0.1;
  constexpr double kDt = 2e-3;
  constexpr double kShear = 1e-3;
  TotalPoint<double> point(kTime);
  for (int n = 0; n < 200; ++n) {
    const double tau = point.advance(shear(kShear), kDt).xy;
    const double mean = -std::expm1(-kDt / kTime) * kTime / kDt;
    EXPECT_NEAR(tau / (kModulus * kShear), mean * std::exp(-n * kDt / kTime), 1e-5);
  }
}

TEST(Maxwell, LossAndStorageOfTheLinearSolid) {
  constexpr double kTime = 0.02;
  constexpr double kShear = 1e-3;
  constexpr int kSteps = 4000;
  for (const double omega : {5.0, 50.0, 500.0}) {
    TotalPoint<double> point(kTime);
    const double dt = 2.0 * std::numbers::pi / omega / kSteps;
    double storage = 0.0;
    double loss = 0.0;
    const int cycles = 1 + static_cast<int>(std::ceil(10.0 * kTime * omega / 6.28));
    for (int n = 0; n < cycles * kSteps; ++n) {
      const double phase = 2.0 * std::numbers::pi * (n % kSteps) / kSteps;
      const double tau = point.advance(shear(kShear * std::sin(phase)), dt).xy;
      if (n < (cycles - 1) * kSteps) continue;
      storage += 2.0 / kSteps * tau * std::sin(phase) / kShear;
      loss += 2.0 / kSteps * tau * std::cos(phase) / kShear;
    }
    const double x = omega * kTime;
    EXPECT_NEAR(storage, kModulus * x * x / (1.0 + x * x), 2e-5 * kModulus) << omega;
    EXPECT_NEAR(loss, kModulus * x / (1.0 + x * x), 2e-5 * kModulus) << omega;
  }
}

TEST(Maxwell, BothFormulationsAgreeAtLargeStrain) {
  constexpr double kTime = 0.3;
  constexpr double kDt = 1e-3;
  TotalPoint<double> total(kTime);
  MaxwellStep<double> steps[material::kMostMaxwellBranches];
  maxwell_steps(total.c, kDt, steps);
  Sym3<double> carried{};
  Mat3d before = Mat3d::Identity();
  for (int n = 1; n <= 900; ++n) {
    const Mat3d f = motion(n * kDt);
    const Mat3d tau_total = from_sym3(total.advance(f, kDt));
    Sym3<double> tau{};
    carried = carry_maxwell<double>(
        steps[0], to_mat3<double>(f * before.inverse() - Mat3d::Identity()), carried, tau);
    before = f;
    EXPECT_LT((from_sym3(tau) - tau_total).norm(), 1e-9 * kModulus) << n;
    EXPECT_LT(std::abs(tau_total.trace()), 1e-9 * kModulus);
  }
}

TEST(Maxwell, StressTurnsWithTheBody) {
  const Mat3d turn = Eigen::AngleAxisd(0.9, Vec3d(3, -1, 2).normalized()).toRotationMatrix();
  TotalPoint<double> a(0.1);
  TotalPoint<double> b(0.1);
  for (int n = 1; n <= 50; ++n) {
    const Mat3d f = motion(0.01 * n);
    const Mat3d plain = from_sym3(a.advance(f, 0.01));
    const Mat3d turned = from_sym3(b.advance(turn * f, 0.01));
    EXPECT_LT((turned - turn * plain * turn.transpose()).norm(), 1e-10 * kModulus);
  }
}

TEST(Maxwell, ClosedCyclesTakeEnergyAway) {
  for (const double time : {1e-3, 0.05, 2.0}) {
    TotalPoint<double> point(time);
    constexpr double kDt = 1e-4;
    constexpr double kPeriod = 0.4;
    double work = 0.0;
    Mat3d before = Mat3d::Identity();
    for (int n = 1; n <= 4000; ++n) {
      const double s = std::sin(2.0 * std::numbers::pi * n * kDt / kPeriod);
      Mat3d f = shear(0.5 * s);
      f(1, 1) += 0.3 * s * s;
      const Mat3d tau = from_sym3(point.advance(f, kDt));
      work += (tau * f.inverse().transpose()).cwiseProduct(f - before).sum();
      before = f;
    }
    EXPECT_GT(work, 0.0) << time;
  }
}

// A substep of 10 µs relaxes a branch of 10 s by a millionth: below a float's last digit.
TEST(Maxwell, SlowBranchesRelaxInFloats) {
  TotalPoint<float> point(10.0);
  float tau = 0.0F;
  for (int n = 0; n < 200'000; ++n) tau = point.advance(shear(0.01), 1e-5).xy;
  EXPECT_NEAR(static_cast<double>(tau) / (0.01 * kModulus), std::exp(-0.2), 2e-5);
}

TEST(Maxwell, RegistersAgreeWithDouble) {
  using D = hn::CappedTag<float, 16>;
  using T = Lanes<D>;
  constexpr std::size_t kWidth = hn::MaxLanes(D());
  TotalPoint<double> reference(0.05);
  const auto c = law_constants<float>(branch(0.05));
  MaxwellStep<float> steps[material::kMostMaxwellBranches];
  maxwell_steps(c, 1e-3F, steps);
  float history[12 * 16] = {};
  for (int n = 1; n <= 100; ++n) {
    const Mat3d f = motion(1e-3 * n);
    const Mat3<double> h = to_mat3<double>(f - Mat3d::Identity());
    Mat3<T> lanes;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) lanes[i][j] = T(static_cast<float>(h[i][j]));
    Sym3<T> tau{T(0.0F), T(0.0F), T(0.0F), T(0.0F), T(0.0F), T(0.0F)};
    add_maxwell_stress<T>(c, steps, lanes, determinant_minus_one(lanes), true, history, 16, tau);
    const Sym3<double> expected = reference.advance(f, 1e-3);
    float got[16];
    tau.xy.store(got);
    for (std::size_t l = 0; l < kWidth; ++l) {
      EXPECT_NEAR(static_cast<double>(got[l]), expected.xy, 2e-6 * kModulus);
    }
  }
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
