// SPDX-License-Identifier: GPL-3.0-or-later
// Adjoints of the laws against central differences in double, for every law, entry and constant;
// and registers of floats against double.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "material/classical/law_at-inl.hpp"
#include "material/classical/law_gradient.hpp"
#include "material/classical/laws_adjoint-inl.hpp"
#include "material/neural/isotropic_material.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

using material::ConstantsAdjoint;
using material::law_constants;
using material::LawConstants;
using material::Material;

constexpr double kDt = 1e-3;

/// A law at a state where it flows, or does not.
struct Case {
  std::string name;
  Material material;
  double strain = 0.0;  ///< size of the deformation
  double jm1 = 0.0;     ///< added to J: compressed or stretched
};

/// A start whose units all speak.
std::shared_ptr<const material::IsotropicStart> loud_start() {
  material::IsotropicWeights w = material::plain_isotropic(4e4, 9e4);
  for (std::size_t i = 2; i < material::kIsotropicElastic; ++i)
    w[i] += 0.3 * std::sin(5.0 * static_cast<double>(i));
  for (std::size_t k = 0; k < material::kShapeUnits; ++k) w[2 + k] = -1.0;
  for (std::size_t k = 0; k < material::kVolumeUnits; ++k) w[18 + k] = -1.5;
  return material::with_directions("loud", w, 1);
}

std::vector<Case> cases() {
  std::vector<Case> all;
  const auto add = [&](const std::string& name, Material m) {
    m.youngs_modulus = 1e5;
    for (const double strain : {0.3, 1e-3}) {
      for (const double volume : {-0.1, 0.05}) {
        all.push_back({name + (strain > 0.1 ? ", large" : ", small") +
                           (volume < 0.0 ? ", pressed" : ", stretched"),
                       m, strain, volume * strain / 0.3});
      }
    }
  };
  Material m;
  m.poisson_ratio = 0.3;
  m.law = Law::kFixedCorotated;
  add("fixed corotated", m);
  m.law = Law::kNeoHookean;
  add("neo-Hookean", m);
  m.poisson_ratio = 0.48;
  add("neo-Hookean, split", m);
  m.poisson_ratio = 0.3;
  m.law = Law::kStvkHencky;
  add("StVK-Hencky", m);
  m.law = Law::kVonMises;
  m.yield_stress = 10.0;
  add("von Mises", m);
  m.hardening = 3e3;
  add("von Mises with hardening", m);
  m.yield_stress = 1e6;
  add("von Mises below yield", m);
  m.hardening = 0.0;
  m.law = Law::kHerschelBulkley;
  m.yield_stress = 5.0;
  add("Herschel-Bulkley without viscosity", m);
  m.viscosity = 40.0;
  for (const double n : {1.0, 0.5, 1.7}) {
    m.exponent = n;
    add("Herschel-Bulkley, exponent " + std::to_string(n), m);
  }
  m.law = Law::kDruckerPrager;
  m.friction_angle = 35.0;
  add("Drucker-Prager", m);
  m.cohesion = 50.0;
  add("Drucker-Prager with cohesion", m);
  m.law = Law::kNewtonian;
  m.bulk_modulus = 2e5;
  add("Newtonian", m);
  m = material::isotropic_material(loud_start());
  m.poisson_ratio = 0.3;
  m.form_1 = 0.2;
  m.form_3 = -0.1;
  add("neural", m);
  m.yield_strain = 1e-4;
  m.internal_friction = 0.1;
  m.strain_hardening = 5e-3;
  m.flow_rate = 2e3;
  m.flow_thinning = 1e3;
  add("neural, yielding", m);
  m.tear_strain = 1e-3;
  add("neural, tearing", m);
  return all;
}

template <class T>
void adjoint_of(const LawConstants<typename LaneTraits<T>::Scalar>& c, const Mat3<T>& h, T jm1,
                T mean, T strain, const Sym3<T>& tau_bar, const Sym3<T>& flow_bar, T strain_bar,
                PointBar<T>& bar, ConstantsAdjoint<T>& c_bar) {
  const T dt = scalar<T>(kDt);
  material::dispatch(traits(c.law).family, [&]<StressFamily kFamily>() {
    kirchhoff_stress_adjoint<kFamily, T>(c, h, jm1, mean, dt, strain, tau_bar, flow_bar, strain_bar,
                                         bar, c_bar);
  });
}

/// One evaluation of L = τ̄ : τ + Ḡ : growth + s̄ · strain, with everything it depends on.
struct Functional {
  Material material;
  Mat3<double> h{};
  double jm1 = 0.0;
  double mean = 0.0;
  double strain = 0.02;
  Mat3<double> l{};  ///< velocity gradient
  Sym3<double> tau_bar{};
  Sym3<double> flow_bar{};
  double strain_bar = 0.0;

  [[nodiscard]] double value(const LawConstants<double>& c) const {
    Sym3<double> flow{};
    double after = strain;
    Sym3<double> tau = kirchhoff_stress_at<double>(c, h, jm1, mean, kDt, flow, after);
    add_crush_pressure<double>(c, jm1, tau);
    add_viscous_stress<double>(c, l, jm1, tau);
    double sum = contract(tau_bar, tau);
    if (c.plastic) sum += contract(flow_bar, flow) + strain_bar * after;
    return sum;
  }
  [[nodiscard]] double value() const { return value(law_constants<double>(material)); }
};

Functional functional(const Case& item, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Functional f;
  f.material = item.material;
  f.material.damping_shear = 30.0;
  f.material.damping_bulk = 20.0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      f.h[i][j] = item.strain * uniform(random) + (i == j ? item.jm1 / 3.0 : 0.0);
      f.l[i][j] = uniform(random);
    }
  f.jm1 = determinant_minus_one(f.h);
  f.mean = 0.9 * f.jm1 + 0.01 * item.strain;
  const auto symmetric = [&] {
    return Sym3<double>{uniform(random), uniform(random), uniform(random),
                        uniform(random), uniform(random), uniform(random)};
  };
  f.tau_bar = symmetric();
  f.flow_bar = scaled(symmetric(), item.material.youngs_modulus);
  f.strain_bar = item.material.youngs_modulus * uniform(random);
  return f;
}

/// Fourth-order central difference of `value` when `x` moves.
double derivative(double& x, double step, const std::function<double()>& value) {
  const double at = x;
  const auto moved = [&](double by) {
    x = at + by;
    const double v = value();
    x = at;
    return v;
  };
  return (8.0 * (moved(step) - moved(-step)) - (moved(2.0 * step) - moved(-2.0 * step))) /
         (12.0 * step);
}

TEST(LawsAdjoint, MatchesDifferencesInEveryEntryAndConstant) {
  std::mt19937 random(7);
  for (const Case& item : cases()) {
    for (int repeat = 0; repeat < 4; ++repeat) {
      Functional f = functional(item, random);
      const auto c = law_constants<double>(f.material);
      PointBar<double> bar{};
      ConstantsAdjoint<double> c_bar{};
      adjoint_of<double>(c, f.h, f.jm1, f.mean, f.strain, f.tau_bar, f.flow_bar, f.strain_bar, bar,
                         c_bar);
      crush_pressure_adjoint<double>(c, f.jm1, f.tau_bar, bar, c_bar);
      Mat3<double> l_bar{};
      viscous_stress_adjoint<double>(c, f.l, f.jm1, f.tau_bar, l_bar, bar, c_bar);
      const double scale = f.material.youngs_modulus;
      const double h_step = 1e-3 * item.strain;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          EXPECT_NEAR(derivative(f.h[i][j], h_step, [&] { return f.value(); }), bar.h[i][j],
                      1e-6 * scale)
              << item.name << " h " << i << j;
          EXPECT_NEAR(derivative(f.l[i][j], 1e-3, [&] { return f.value(); }), l_bar[i][j], 1e-6)
              << item.name << " l " << i << j;
        }
      EXPECT_NEAR(derivative(f.jm1, 0.3 * h_step, [&] { return f.value(); }), bar.jm1, 1e-6 * scale)
          << item.name;
      EXPECT_NEAR(derivative(f.mean, h_step, [&] { return f.value(); }), bar.mean, 1e-6 * scale)
          << item.name;
      if (c.plastic) {
        EXPECT_NEAR(derivative(f.strain, 1e-4, [&] { return f.value(); }), bar.strain, 1e-6 * scale)
            << item.name;
      }
      // Through law_constants() to the material's own parameters.
      const material::MaterialGradient g = material_gradient(f.material, c_bar);
      const auto parameter = [&](const char* name, double Material::*member, double gradient) {
        double& x = f.material.*member;
        const double step = 1e-4 * std::max(std::abs(x), 1e-3);
        const double expected = derivative(x, step, [&] { return f.value(); });
        const double size = std::max(std::abs(expected), 1e-5 * scale / std::max(x, 1e-3));
        EXPECT_NEAR(expected, gradient, 2e-6 * size) << item.name << " " << name;
      };
      parameter("E", &Material::youngs_modulus, g.youngs_modulus);
      parameter("nu", &Material::poisson_ratio, g.poisson_ratio);
      parameter("yield", &Material::yield_stress, g.yield_stress);
      if (f.material.hardening > 0.0) parameter("hardening", &Material::hardening, g.hardening);
      if (f.material.viscosity > 0.0) {
        parameter("viscosity", &Material::viscosity, g.viscosity);
        parameter("exponent", &Material::exponent, g.exponent);
      }
      if (f.material.law == Law::kDruckerPrager) {
        parameter("friction angle", &Material::friction_angle, g.friction_angle);
        if (f.material.cohesion > 0.0) parameter("cohesion", &Material::cohesion, g.cohesion);
      }
      if (f.material.law == Law::kNeuralIsotropic) {
        parameter("form 1", &Material::form_1, g.form_1);
        parameter("form 4", &Material::form_4, g.form_4);
        if (c.plastic) {
          parameter("friction", &Material::internal_friction, g.internal_friction);
          parameter("hardening", &Material::strain_hardening, g.strain_hardening);
          parameter("rate", &Material::flow_rate, g.flow_rate);
          parameter("thinning", &Material::flow_thinning, g.flow_thinning);
        }
      }
      parameter("bulk modulus", &Material::bulk_modulus, g.bulk_modulus);
      parameter("damping", &Material::damping_shear, g.damping_shear);
      parameter("bulk damping", &Material::damping_bulk, g.damping_bulk);
    }
  }
}

// Two and three equal stretches, and none: where eigenvectors are anybody's.
TEST(LawsAdjoint, RepeatedEigenvaluesAreNoExceptions) {
  std::mt19937 random(11);
  for (const Case& item : cases()) {
    for (const Vec3d& stretch : {Vec3d(1.2, 1.2, 0.9), Vec3d(0.97, 0.97, 0.97), Vec3d(1, 1, 1)}) {
      Functional f = functional(item, random);
      const bool kink = f.material.law == Law::kDruckerPrager ||
                        f.material.law == Law::kNeuralIsotropic || f.material.yield_stress < 100.0;
      // A rigid state lies on the kink of what yields at once.
      if (f.material.law != Law::kNewtonian && kink && stretch[0] == stretch[2] &&
          law_constants<double>(f.material).plastic) {
        continue;
      }
      const Mat3d turn = Eigen::AngleAxisd(0.7, Vec3d(1, -2, 3).normalized()).toRotationMatrix();
      const Mat3d g = turn * stretch.asDiagonal() * turn.transpose();
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) f.h[i][j] = g(i, j) - (i == j ? 1.0 : 0.0);
      f.jm1 = determinant_minus_one(f.h);
      f.mean = f.jm1;
      PointBar<double> bar{};
      ConstantsAdjoint<double> c_bar{};
      const auto c = law_constants<double>(f.material);
      adjoint_of<double>(c, f.h, f.jm1, f.mean, f.strain, f.tau_bar, f.flow_bar, f.strain_bar, bar,
                         c_bar);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          EXPECT_NEAR(derivative(f.h[i][j], 1e-4, [&] { return f.value(); }), bar.h[i][j],
                      1e-6 * f.material.youngs_modulus)
              << item.name << " " << stretch.transpose() << " h " << i << j;
        }
    }
  }
}

TEST(LawsAdjoint, CrushedVolumesPushBack) {
  std::mt19937 random(5);
  Case item{"crushed", Material{}, 0.05, 0.0};
  Functional f = functional(item, random);
  for (int i = 0; i < 3; ++i) f.h[i][i] -= 0.3;
  f.jm1 = determinant_minus_one(f.h);
  f.mean = f.jm1;
  ASSERT_LT(f.jm1, -0.55);
  const auto c = law_constants<double>(f.material);
  PointBar<double> bar{};
  ConstantsAdjoint<double> c_bar{};
  crush_pressure_adjoint<double>(c, f.jm1, f.tau_bar, bar, c_bar);
  const auto value = [&] {
    Sym3<double> tau{};
    add_crush_pressure<double>(law_constants<double>(f.material), f.jm1, tau);
    return contract(f.tau_bar, tau);
  };
  EXPECT_NEAR(derivative(f.jm1, 1e-4, value), bar.jm1, 1e-6 * std::abs(bar.jm1));
  const material::MaterialGradient g = material_gradient(f.material, c_bar);
  EXPECT_NEAR(derivative(f.material.youngs_modulus, 10.0, value), g.youngs_modulus,
              1e-6 * std::abs(g.youngs_modulus));
  EXPECT_NEAR(derivative(f.material.poisson_ratio, 1e-4, value), g.poisson_ratio,
              1e-6 * std::abs(g.poisson_ratio));
}

TEST(LawsAdjoint, RegistersOfFloatsAgreeWithDouble) {
  using D = hn::CappedTag<float, 16>;
  using T = Lanes<D>;
  std::mt19937 random(3);
  const auto spread = [](const Sym3<double>& s) {
    const auto one = [](double x) { return T(static_cast<float>(x)); };
    return Sym3<T>{one(s.xx), one(s.yy), one(s.zz), one(s.yz), one(s.xz), one(s.xy)};
  };
  for (const Case& item : cases()) {
    const Functional f = functional(item, random);
    PointBar<double> expected{};
    ConstantsAdjoint<double> unused{};
    adjoint_of<double>(law_constants<double>(f.material), f.h, f.jm1, f.mean, f.strain, f.tau_bar,
                       f.flow_bar, f.strain_bar, expected, unused);
    Mat3<T> h;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) h[i][j] = T(static_cast<float>(f.h[i][j]));
    PointBar<T> bar{};
    ConstantsAdjoint<T> ignored{};
    adjoint_of<T>(law_constants<float>(f.material), h, T(static_cast<float>(f.jm1)),
                  T(static_cast<float>(f.mean)), T(static_cast<float>(f.strain)), spread(f.tau_bar),
                  spread(f.flow_bar), T(static_cast<float>(f.strain_bar)), bar, ignored);
    double size = 0.0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) size = std::max(size, std::abs(expected.h[i][j]));
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        float lanes[hn::MaxLanes(D())];
        bar.h[i][j].store(lanes);
        EXPECT_NEAR(static_cast<double>(lanes[0]), expected.h[i][j], 1e-3 * size)
            << item.name << " h " << i << j;
      }
  }
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
