// SPDX-License-Identifier: GPL-3.0-or-later
// The isotropic neural law as a material: its numbers, their derivatives, the kernels' form of it.
#include "material/neural/isotropic_material.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/random.hpp"
#include "material/classical/elastic_energy.hpp"
#include "material/classical/law_constants.hpp"
#include "material/classical/laws_adjoint-inl.hpp"
#include "material/classical/point_law.hpp"
#include "material/neural/isotropic_law.hpp"
#include "material/neural/pretrain.hpp"

namespace matterfit::material {
namespace {

/// A start whose units all speak.
std::shared_ptr<const IsotropicStart> loud_start() {
  Random random(5);
  IsotropicWeights w = plain_isotropic(1e4, 2e4);
  for (std::size_t i = 1; i < kIsotropicElastic; ++i) w[i] += random.between(-0.3, 0.3);
  for (std::size_t k = 0; k < kShapeUnits; ++k) w[2 + k] = random.between(-2.0, -1.0);
  for (std::size_t k = 0; k < kVolumeUnits; ++k) {
    w[2 + 4 * kShapeUnits + k] = random.between(-2.0, -1.0);
  }
  return with_directions("loud", w, 1);
}

Material loud_material() {
  Material m = isotropic_material(loud_start());
  m.youngs_modulus = 3e4;
  m.poisson_ratio = 0.33;
  m.form_1 = 0.2;
  m.form_2 = -0.1;
  m.form_3 = 0.15;
  m.form_4 = 0.05;
  m.yield_strain = 0.05;
  m.internal_friction = 0.2;
  m.strain_hardening = 0.3;
  m.tear_strain = 0.04;
  m.flow_rate = 3e3;
  m.flow_thinning = 2e3;
  return m;
}

TEST(IsotropicMaterial, HasTheModuliThatItSays) {
  Material m = loud_material();
  for (const double nu : {0.1, 0.3, 0.48}) {
    for (const double form : {-0.5, 0.0, 0.7}) {
      m.poisson_ratio = nu;
      m.form_1 = form;
      const RestStiffness rest = rest_stiffness(isotropic_constants(m));
      EXPECT_NEAR(rest.shear / (m.youngs_modulus / (2.0 + 2.0 * nu)), 1.0, 1e-12);
      EXPECT_NEAR(
          (rest.bulk_by_shape + rest.bulk_by_volume) / (m.youngs_modulus / (3.0 - 6.0 * nu)), 1.0,
          1e-12);
    }
  }
}

TEST(IsotropicMaterial, BeginsAsItsStart) {
  const auto start = loud_start();
  auto from = isotropic_constants(isotropic_material(start));
  auto to = isotropic_constants<double>(start->weights);
  std::vector<double> expected;
  to.for_each([&](double entry) { expected.push_back(entry); });
  std::size_t i = 0;
  from.for_each([&](double entry) {
    const double small = i >= kIsotropicElastic ? 2e-6 : 0.0;  // 1e-6 of a file is 0
    EXPECT_NEAR(entry, expected[i], 1e-12 * std::abs(expected[i]) + small) << i;
    ++i;
  });
}

TEST(IsotropicMaterial, DirectionsChangeTheStressAndNotTheModuli) {
  const auto start = loud_start();
  for (const IsotropicWeights& direction : start->directions) {
    EXPECT_EQ(direction[0], 0.0);
    double size = 0.0;
    for (std::size_t i = 0; i < kIsotropicElastic; ++i) size += direction[i] * direction[i];
    EXPECT_GT(size, 0.1);
    for (std::size_t i = kIsotropicElastic; i < kIsotropicWeights; ++i) {
      EXPECT_EQ(direction[i], 0.0);
    }
  }
  Material m = isotropic_material(start);
  const PointLaw before(m, 1e-4);
  m.form_1 = 0.1;
  const PointLaw after(m, 1e-4);
  Random random(3);
  double changed = 0.0;
  double most = 0.0;
  for (int k = 0; k < 50; ++k) {
    Mat3d f = Mat3d::Identity();
    for (int i = 0; i < 9; ++i) f(i / 3, i % 3) += random.between(-0.3, 0.3);
    if (f.determinant() < 0.4) continue;
    PointState one;
    PointState other;
    const Mat3d tau = before.advance(f, one);
    const double change = (after.advance(f, other) - tau).norm() / tau.norm();
    changed += change / 50.0;
    most = std::max(most, change);
  }
  EXPECT_GT(changed, 0.01) << "a tenth of a unit is to be about a tenth of the stress";
  EXPECT_LT(most, 0.5);
}

/// The adjoint of the law's constants down to the numbers, against differences of fourth order.
TEST(IsotropicMaterial, NumbersHaveTheirDerivatives) {
  const Material m = loud_material();
  const auto weighted = [](const Material& of) {  // any smooth function of all constants
    auto c = isotropic_constants(of);
    double sum = 0.0;
    double at = 0.0;
    c.for_each([&](double entry) { sum += std::sin(1.0 + at++) * std::log1p(std::abs(entry)); });
    return sum;
  };
  IsotropicConstants<double> bar = isotropic_constants(m);
  double at = 0.0;
  bar.for_each([&](double& entry) {
    entry = std::sin(1.0 + at++) * std::copysign(1.0, entry) / (1.0 + std::abs(entry));
  });
  ConstantsAdjoint<double> all{};
  all.neural = bar;
  const MaterialGradient found = material_gradient(m, all);
  const auto check = [&](double Material::*member, double slope, const char* name) {
    const double step = 1e-3 * std::max(std::abs(m.*member), 0.1);
    const auto moved = [&](double by) {
      Material other = m;
      other.*member += by * step;
      return weighted(other);
    };
    const double expected =
        (8.0 * (moved(1.0) - moved(-1.0)) - (moved(2.0) - moved(-2.0))) / (12.0 * step);
    EXPECT_NEAR(slope, expected, 1e-7 * std::abs(expected) + 1e-12) << name;
  };
  check(&Material::youngs_modulus, found.youngs_modulus, "E");
  check(&Material::poisson_ratio, found.poisson_ratio, "nu");
  check(&Material::form_1, found.form_1, "form_1");
  check(&Material::form_2, found.form_2, "form_2");
  check(&Material::form_3, found.form_3, "form_3");
  check(&Material::form_4, found.form_4, "form_4");
  check(&Material::yield_strain, found.yield_strain, "yield_strain");
  check(&Material::internal_friction, found.internal_friction, "internal_friction");
  check(&Material::strain_hardening, found.strain_hardening, "strain_hardening");
  check(&Material::tear_strain, found.tear_strain, "tear_strain");
  check(&Material::flow_rate, found.flow_rate, "flow_rate");
  check(&Material::flow_thinning, found.flow_thinning, "flow_thinning");
}

/// The solver's law at a point is the law on many points (isotropic_law.hpp).
TEST(IsotropicMaterial, PointLawIsTheLawOfItsWeights) {
  Material m = isotropic_material(loud_start());
  m.yield_strain = 0.08;
  m.flow_rate = 2e3;
  IsotropicWeights weights = m.start->weights;
  weights[kYieldWeight] = std::log(m.yield_strain);
  weights[kRateWeight] = std::log(m.flow_rate);
  const double dt = 1e-3;
  const PointLaw law(m, dt);
  Arena arena(1);
  Random random(8);
  for (int k = 0; k < 20; ++k) {
    Mat3d f = Mat3d::Identity();
    for (int i = 0; i < 9; ++i) f(i / 3, i % 3) += random.between(-0.25, 0.25);
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> trial = f;
    const double before = 0.1;
    double elastic[9];
    double strain = 0.0;
    double tau[6];
    isotropic_forward<double>(weights, dt, {{trial.data(), 9}, {&before, 1}},
                              {{elastic, 9}, {&strain, 1}, {tau, 6}}, arena);
    PointState state;
    state.strain = before;
    const Mat3d stress = law.advance(f, state);
    const double size = stress.norm();
    EXPECT_NEAR(stress(0, 0), tau[0], 1e-5 * size);
    EXPECT_NEAR(stress(1, 2), tau[3], 1e-5 * size);
    EXPECT_NEAR(state.strain, strain, 1e-6);
    EXPECT_NEAR(state.elastic(0, 1), elastic[1], 1e-6);
  }
}

/// With and without a mean dilatation that two points share, as the total Lagrangian kernel has it.
TEST(IsotropicMaterial, StressIsTheDerivativeOfTheEnergy) {
  Material m = loud_material();
  m.yield_strain = m.tear_strain = 1e3;
  const auto c = law_constants<double>(m);
  const double v1 = 0.7;
  const double v2 = 1.9;
  const double j2 = 1.2;
  Random random(4);
  for (int k = 0; k < 20; ++k) {
    Mat3d f = Mat3d::Identity();
    for (int i = 0; i < 9; ++i) f(i / 3, i % 3) += random.between(-0.3, 0.3);
    if (f.determinant() < 0.3) continue;
    const auto mean = [&](const Mat3d& g) { return (v1 * g.determinant() + v2 * j2) / (v1 + v2); };
    const auto energy = [&](const Mat3d& g) {
      return (v1 * shape_energy(c, g) + (v1 + v2) * volume_energy(c, mean(g))) / v1;
    };
    HWY_NAMESPACE::Mat3<double> h;
    for (int i = 0; i < 9; ++i) h[i / 3][i % 3] = f(i / 3, i % 3) - (i % 4 == 0 ? 1.0 : 0.0);
    HWY_NAMESPACE::Sym3<double> flow{};
    double strain = 0.0;
    const auto tau = HWY_NAMESPACE::stress_hencky<double>(c, h, f.determinant() - 1.0,
                                                          mean(f) - 1.0, 1e-4, flow, strain);
    Mat3d p;
    for (int i = 0; i < 9; ++i) {
      const double step = 1e-4;
      const auto moved = [&](double by) {
        Mat3d g = f;
        g(i / 3, i % 3) += by * step;
        return energy(g);
      };
      p(i / 3, i % 3) =
          (8.0 * (moved(1.0) - moved(-1.0)) - (moved(2.0) - moved(-2.0))) / (12.0 * step);
    }
    const Mat3d expected = p * f.transpose();
    EXPECT_NEAR(tau.xx, expected(0, 0), 1e-6 * expected.norm());
    EXPECT_NEAR(tau.zz, expected(2, 2), 1e-6 * expected.norm());
    EXPECT_NEAR(tau.xy, expected(0, 1), 1e-6 * expected.norm());
  }
}

TEST(IsotropicMaterial, ClassesFollowFromItsNumbers) {
  Material m = isotropic_material(loud_start());
  EXPECT_TRUE(m.traits().elastic());
  m.yield_strain = 0.02;
  EXPECT_TRUE(m.traits().plastic && !m.traits().flows);
  m.yield_strain = 1e-5;
  EXPECT_TRUE(m.traits().wets);
  m.tear_strain = 0.0;
  EXPECT_TRUE(m.traits().flows && !m.traits().mean_dilatation);
  EXPECT_GE(m.stiffest_modulus(), m.p_wave_modulus() * 0.999);
}

TEST(IsotropicMaterial, FileGoesThereAndBack) {
  const auto start = loud_start();
  const auto again = isotropic_start(start_tensors(*start), "again");
  for (std::size_t i = 0; i < kIsotropicWeights; ++i) {
    EXPECT_NEAR(again->weights[i], start->weights[i], 1e-6 * std::abs(start->weights[i]) + 1e-7);
    EXPECT_NEAR(again->directions[2][i], start->directions[2][i], 1e-5);
  }
  Tensors broken = start_tensors(*start);
  broken.tensors.erase("directions");
  EXPECT_THROW((void)isotropic_start(broken, "broken"), Error);
  broken = start_tensors(*start);
  broken.tensors["isotropic"].values[3] = std::nanf("");
  EXPECT_THROW((void)isotropic_start(broken, "broken"), Error);
}

}  // namespace
}  // namespace matterfit::material
