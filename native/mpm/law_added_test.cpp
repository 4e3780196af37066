// SPDX-License-Identifier: GPL-3.0-or-later
// What it takes to add a law: this file alone, with a law that exists nowhere else, its row of the
// table, and its kernels in double for the lowest instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.hpp"
#include "mpm/law_kernels.hpp"
#include "mpm/terms_for_test.hpp"
#include "mpm/total_adjoint_kernel-inl.hpp"
#include "mpm/updated_adjoint_kernel-inl.hpp"
#include "mpm/updated_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {

inline constexpr StressFamily kPower = StressFamily{64};

/// A power-law neo-Hookean solid (after Knowles 1977), n = `exponent`, that creeps where it is
/// plastic:
///   τ = μ sⁿ⁻¹ (B − I) + λ (ln J̄/J̄) J I,  s = 1 + tr(B − I) − 2 ln J,
///   flow = −(dt μ/η) dev E,  E = ½ (FᵀF − I),  η = `eta`.
template <>
struct AddedStress<kPower> {
  template <class T>
  HWY_INLINE static Sym3<T> stress(const Constants<T>& c, const Mat3<T>& h, T jm1, T mean, T dt,
                                   Sym3<T>& flow, T& /*strain*/) {
    const Sym3<T> b = left_cauchy_green_minus_identity(h);
    const T pressure = T(c.lambda) * log1p(mean) * (jm1 + scalar<T>(1)) / (mean + scalar<T>(1));
    if (c.plastic) flow = scaled(deviator(green(h)), -rate(c, dt));
    return add_diagonal(scaled(b, T(c.mu) * power_of(c, size(b, jm1))), pressure);
  }

  template <class T>
  HWY_INLINE static void adjoint(const Constants<T>& c, const Mat3<T>& h, T jm1, T mean, T dt,
                                 T /*strain*/, const Sym3<T>& tau_bar, const Sym3<T>& flow_bar,
                                 T strain_bar, PointBar<T>& bar, ConstantsBar<T>& c_bar) {
    const Sym3<T> b = left_cauchy_green_minus_identity(h);
    const Mat3<T> f = plus_identity(h);
    const T one = scalar<T>(1);
    const T j = jm1 + one;
    const T s = size(b, jm1);
    const T power = power_of(c, s);
    const T along = contract(tau_bar, b);
    const T power_bar = T(c.mu) * along * power;
    const T s_bar = power_bar * (T(c.exponent) - one) / s;
    c_bar.mu += power * along;
    c_bar.exponent += power_bar * log(s);
    bar.jm1 -= scalar<T>(2) * s_bar / j;
    add_twice(multiply(add_diagonal(scaled(tau_bar, T(c.mu) * power), s_bar), f), bar.h);

    const T trace = tau_bar.xx + tau_bar.yy + tau_bar.zz;
    const T inverse = one / (mean + one);
    const T log_mean = log1p(mean);
    c_bar.lambda += trace * log_mean * j * inverse;
    bar.jm1 += trace * T(c.lambda) * log_mean * inverse;
    bar.mean += trace * T(c.lambda) * j * (one - log_mean) * inverse * inverse;

    if (!c.plastic) return;
    const Sym3<T> along_flow = deviator(flow_bar);
    const T rate_bar = -contract(along_flow, green(h));
    c_bar.mu += rate_bar * dt / T(c.eta);
    c_bar.eta -= rate_bar * rate(c, dt) / T(c.eta);
    add(multiply(f, scaled(along_flow, -rate(c, dt))), bar.h);
    bar.strain += strain_bar;
  }

 private:
  template <class T>
  HWY_INLINE static T size(const Sym3<T>& b, T jm1) {
    return scalar<T>(1) + b.xx + b.yy + b.zz - scalar<T>(2) * log1p(jm1);
  }
  template <class T>
  HWY_INLINE static T power_of(const Constants<T>& c, T s) {
    return exp((T(c.exponent) - scalar<T>(1)) * log(s));
  }
  template <class T>
  HWY_INLINE static T rate(const Constants<T>& c, T dt) {
    return dt * T(c.mu / c.eta);
  }
  template <class T>
  HWY_INLINE static Sym3<T> green(const Mat3<T>& h) {
    return scaled(right_cauchy_green_minus_identity(h), scalar<T>(0.5));
  }
};

void power_total_forces(const mpm::TotalView<double>& view, std::size_t block) {
  if (view.law.damped) {
    total_forces_law<kPower, true, double>(view, block);
  } else {
    total_forces_law<kPower, false, double>(view, block);
  }
}
void power_total_adjoint(const mpm::TotalAdjointView<double>& view, std::size_t block) {
  static thread_local std::vector<double> slots;
  TotalForcesAdjoint<kPower, double>(view, block).run(slots);
}
void power_updated_block(mpm::UpdatedView<double>& view) {
  updated_block_law<kPower, double>(view);
}
void power_updated_adjoint(mpm::UpdatedAdjointView<double>& view) {
  UpdatedBlockAdjoint<kPower, double>(view).run();
}

}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

namespace matterfit::mpm {
namespace {

using material::Law;
using material::LawTraits;

double power_energy(const material::LawConstants<double>& law, const Mat3d& f) {
  const double s = f.squaredNorm() - 2.0 - 2.0 * std::log(f.determinant());
  return 0.5 * law.mu / law.exponent * (std::pow(s, law.exponent) - 1.0);
}
double log_energy(const material::LawConstants<double>& law, double j) {
  return 0.5 * law.lambda * std::log(j) * std::log(j);
}

LawTraits power_row(bool creeps) {
  static constexpr std::array<std::string_view, 4> kParameters = {"E", "nu", "exponent",
                                                                  "viscosity"};
  return {.name = creeps ? "power_creeping" : "power",
          .label = "Power Law",
          .family = HWY_NAMESPACE::kPower,
          .parameters = std::span(kParameters).first(creeps ? 4 : 3),
          .plastic = creeps,
          .mean_dilatation = !creeps,
          .energy = {power_energy, log_energy}};
}

/// In the table as long as it lives.
struct PowerLaw : AddedLaw {
  explicit PowerLaw(bool creeps = false)
      : AddedLaw(power_row(creeps), {},
                 {.total_forces = HWY_NAMESPACE::power_total_forces,
                  .total_forces_adjoint = HWY_NAMESPACE::power_total_adjoint,
                  .updated_block = HWY_NAMESPACE::power_updated_block,
                  .updated_block_adjoint = HWY_NAMESPACE::power_updated_adjoint}) {}
};

TermCase power_case(Formulation formulation, Law law) {
  TermCase run(formulation, {});
  run.material.law = law;
  run.material.youngs_modulus = 2e4;
  run.material.exponent = 2.5;
  run.material.viscosity = 200.0;
  run.stir = 3.0;
  run.frames = 5;
  return run;
}

class LawOfTests : public ::testing::TestWithParam<Formulation> {};

TEST_P(LawOfTests, OfExponentOneIsNeoHookean) {
  const PowerLaw power;
  TermCase run = power_case(GetParam(), power.law());
  const Schedule schedule = run.gradient<double>().schedule;
  const double stiffening = run.loss(schedule);
  run.material.exponent = 1.0;
  const double plain = run.loss(schedule);
  run.material.law = Law::kNeoHookean;
  const double neo_hookean = run.loss(schedule);
  EXPECT_NEAR(plain, neo_hookean, 1e-9 * neo_hookean);
  EXPECT_GT(std::abs(stiffening - plain), 1e-2);
}

TEST_P(LawOfTests, HasItsDerivatives) {
  for (const bool creeps : {false, true}) {
    SCOPED_TRACE(creeps ? "creeping" : "elastic");
    const PowerLaw power(creeps);
    TermCase run = power_case(GetParam(), power.law());
    if (creeps) run.material.damping_shear = 5.0;
    expect_gradient(run);
    const Gradient g = run.gradient<double>();
    const material::MaterialGradient& found = g.bodies[0].material;
    expect_slope(run, g.schedule, "exponent", found.exponent, 1e-3,
                 [](TermCase& c, double by) { c.material.exponent += by; });
    expect_slope(run, g.schedule, "nu", found.poisson_ratio, 1e-4,
                 [](TermCase& c, double by) { c.material.poisson_ratio += by; });
    EXPECT_GT(std::abs(found.exponent), 1e-2);
    if (!creeps) {
      EXPECT_EQ(found.viscosity, 0.0);
      continue;
    }
    expect_slope(run, g.schedule, "viscosity", found.viscosity, 0.2,
                 [](TermCase& c, double by) { c.material.viscosity += by; });
    EXPECT_GT(std::abs(run.material.viscosity * found.viscosity), 1e-2);
  }
}

INSTANTIATE_TEST_SUITE_P(Formulations, LawOfTests,
                         ::testing::Values(Formulation::kTotal, Formulation::kUpdated),
                         [](const auto& info) {
                           return info.param == Formulation::kTotal ? "total" : "updated";
                         });

TEST(AddedLaw, IsInTheTableForAsLongAsItLives) {
  const std::size_t before = material::all_laws().size();
  {
    const PowerLaw power;
    EXPECT_EQ(material::all_laws().size(), before + 1);
    EXPECT_EQ(material::law_from_name("power"), power.law());
    EXPECT_TRUE(material::traits(power.law()).uses("exponent"));
    EXPECT_THROW(PowerLaw(), Error) << "twice";
    LawTraits row = power_row(true);
    row.family = material::StressFamily::kHencky;
    EXPECT_THROW(AddedLaw(row, {}, {}), Error) << "of the library's family";
    row = power_row(false);
    row.name = "without an energy";
    row.energy = {};
    EXPECT_THROW(AddedLaw(row, {}, {}), Error);
    EXPECT_EQ(material::all_laws().size(), before + 1);
  }
  EXPECT_EQ(material::all_laws().size(), before);
  EXPECT_THROW((void)material::law_from_name("power"), Error);
}

TEST(AddedLaw, IsRefusedWhereItHasNoKernels) {
  const PowerLaw power;
  const auto message = [&](Formulation formulation) -> std::string {
    Scene scene = power_case(formulation, power.law()).scene();
    try {
      (void)last_state(scene);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(message(Formulation::kRenewed).find("no kernels for the formulation 'renewed'"),
            std::string::npos);
  EXPECT_NE(message(Formulation::kTotal).find("the law power has no kernels"), std::string::npos);
  EXPECT_NE(message(Formulation::kUpdated).find("the law power has no kernels"), std::string::npos);
}

}  // namespace
}  // namespace matterfit::mpm
