// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/splat.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>
#include <random>

#include "bake/test_support.hpp"
#include "capture/spherical_harmonics.hpp"

namespace matterfit::bake {
namespace {

Mat3d random_rotation(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
      .normalized()
      .toRotationMatrix();
}

double evaluate(std::span<const float> sh, int degree, const Vec3d& direction) {
  const auto basis = capture::sh_basis(direction);
  double sum = 0.0;
  for (std::size_t k = 0; k < splat::sh_bands(degree); ++k) {
    sum += basis[k] * static_cast<double>(sh[3 * k + 1]);
  }
  return sum;
}

// The basis is orthonormal on the sphere: an integral that knows nothing of the formulas.
TEST(SphericalHarmonics, AreOrthonormal) {
  const int n = 400;
  Eigen::Matrix<double, 16, 16> gram = Eigen::Matrix<double, 16, 16>::Zero();
  for (int i = 0; i < n; ++i) {
    const double z = -1.0 + (2.0 * i + 1.0) / n;
    const double r = std::sqrt(1.0 - z * z);
    for (int j = 0; j < 16; ++j) {
      const double angle = 2.0 * std::numbers::pi * j / 16;
      const auto b = capture::sh_basis({r * std::cos(angle), r * std::sin(angle), z});
      const Eigen::Map<const Eigen::Matrix<double, 16, 1>> v(b.data());
      gram += v * v.transpose() * (4.0 * std::numbers::pi / (n * 16));
    }
  }
  EXPECT_LT((gram - Eigen::Matrix<double, 16, 16>::Identity()).cwiseAbs().maxCoeff(), 1e-3);
}

// f'(d) = f(Rᵀ d), by direct evaluation.
TEST(SphericalHarmonics, RotateAsFunctions) {
  std::mt19937 random(11);
  std::normal_distribution<float> normal;
  for (int trial = 0; trial < 20; ++trial) {
    const Mat3d rotation = random_rotation(random);
    const capture::ShRotation sh_rotation(rotation);
    for (int degree = 0; degree <= 3; ++degree) {
      std::vector<float> before(static_cast<std::size_t>(3 * (degree + 1) * (degree + 1)));
      for (float& c : before) c = normal(random);
      std::vector<float> after = before;
      sh_rotation.apply(after, degree);
      for (int k = 0; k < 10; ++k) {
        const Vec3d d = random_rotation(random).col(0);
        EXPECT_NEAR(evaluate(after, degree, d), evaluate(before, degree, rotation.transpose() * d),
                    2e-5);
      }
    }
  }
}

// A function of degree 1 is a vector: d · a with a = C₁(−c₃, −c₁, c₂); it must turn as one.
TEST(SphericalHarmonics, DegreeOneTurnsAsAVector) {
  std::mt19937 random(5);
  const Mat3d rotation = random_rotation(random);
  std::vector<float> sh(12, 0.0F);
  sh[3] = 0.3F;
  sh[6] = -0.7F;
  sh[9] = 0.5F;
  const auto vector = [&] {
    return Vec3d(-static_cast<double>(sh[9]), -static_cast<double>(sh[3]),
                 static_cast<double>(sh[6]));
  };
  const Vec3d expected = rotation * vector();
  capture::ShRotation(rotation).apply(sh, 1);
  EXPECT_LT((vector() - expected).norm(), 1e-6);
}

TEST(SplatCovariance, PureRotationTurnsTheAxesAndKeepsScales) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 50; ++trial) {
    const Mat3d r0 = random_rotation(random);
    const Mat3d r = random_rotation(random);
    const Vec3d scales(0.001, 0.2, 0.03);
    const Ellipsoid e = transport_covariance(r, capture::polar_rotation(r), r0, scales);
    EXPECT_LT((e.rotation - r * r0).norm(), 1e-9);
    EXPECT_LT((e.scales - scales).norm(), 1e-12);
  }
}

// Σ' = F Σ Fᵀ for shear, stretch, needles and reflections; the rotation stays proper.
TEST(SplatCovariance, IsTheTransportedCovariance) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 200; ++trial) {
    Mat3d f;
    for (int k = 0; k < 9; ++k) f(k / 3, k % 3) = normal(random);
    if (trial == 0) f << 1, 2, 0, 0, 1, 0, 0, 0, 1;
    const Mat3d r0 = random_rotation(random);
    const Vec3d scales(1e-4, 0.2, 0.03);
    const Ellipsoid e = transport_covariance(f, capture::polar_rotation(f), r0, scales);
    const Mat3d expected =
        f * r0 * scales.cwiseAbs2().asDiagonal() * r0.transpose() * f.transpose();
    const Mat3d got = e.rotation * e.scales.cwiseAbs2().asDiagonal() * e.rotation.transpose();
    EXPECT_LT((got - expected).norm(), 1e-10 * expected.norm()) << trial;
    EXPECT_NEAR(e.rotation.determinant(), 1.0, 1e-10);
    // The volume, which the small axis decides: σ₁σ₂σ₃ = |det F| s₁s₂s₃.
    EXPECT_NEAR(e.scales.prod() / (std::abs(f.determinant()) * scales.prod()), 1.0, 1e-6);
  }
}

class SplatTest : public FolderTest {
 protected:
  static capture::Splats some_splats(int degree) {
    std::mt19937 random(9);
    std::uniform_real_distribution<float> uniform(-0.35F, 0.35F);
    std::normal_distribution<float> normal;
    capture::Splats splats;
    splats.sh_degree = degree;
    for (int i = 0; i < 30; ++i) {
      splats.means.emplace_back(uniform(random), uniform(random), uniform(random));
      splats.rotations.push_back(
          Eigen::Quaternionf(normal(random), normal(random), normal(random), normal(random))
              .normalized());
      splats.scales.emplace_back(0.01F, 0.02F, 0.015F);
      splats.opacities.push_back(0.3F + 0.02F * static_cast<float>(i));
      for (std::size_t k = 0; k < 3 * splats.sh_bands(); ++k) splats.sh.push_back(normal(random));
    }
    return splats;
  }
  static std::vector<Vec3d> means_of(const capture::Splats& splats) {
    std::vector<Vec3d> means;
    for (const Vec3f& m : splats.means) means.push_back(m.cast<double>());
    return means;
  }
  Arena arena_{2};
};

// A rotated body: the frame in the file is the rest splats, seen from a turned camera.
TEST_F(SplatTest, RigidMotionThroughTheFile) {
  Specimen body = cube(0.05, 0.4);
  const Mat3d r = Eigen::AngleAxisd(1.1, Vec3d(1, -2, 0.5).normalized()).toRotationMatrix();
  const Vec3d b(4.0, 5.0, 6.0);
  body.move(r, b);
  for (int degree = 0; degree <= 3; ++degree) {
    const capture::Splats rest = some_splats(degree);
    const capture::MeshBinding binding(means_of(rest), body.rest, 0.05, {}, arena_);
    const SplatReport report =
        write_splat_frame(folder_ / "splat.ply", rest, binding, body.view(), {}, arena_);
    EXPECT_EQ(report.needles, 0U);
    const capture::Splats moved = capture::read_splats(folder_ / "splat.ply");
    ASSERT_EQ(moved.size(), rest.size());
    ASSERT_EQ(moved.sh_degree, degree);
    for (std::size_t i = 0; i < rest.size(); ++i) {
      EXPECT_LT((moved.means[i].cast<double>() - (r * rest.means[i].cast<double>() + b)).norm(),
                1e-5);
      EXPECT_LT((moved.scales[i] - rest.scales[i]).norm(), 1e-6F);
      EXPECT_NEAR(moved.opacities[i], rest.opacities[i], 1e-6F);
      EXPECT_LT((moved.rotations[i].toRotationMatrix().cast<double>() -
                 r * rest.rotations[i].toRotationMatrix().cast<double>())
                    .norm(),
                1e-5);
      const std::size_t stride = 3 * rest.sh_bands();
      const Vec3d view = Vec3d(0.3, -0.5, 0.8).normalized();
      EXPECT_NEAR(evaluate({moved.sh.data() + i * stride, stride}, degree, view),
                  evaluate({rest.sh.data() + i * stride, stride}, degree, r.transpose() * view),
                  1e-4);
    }
  }
}

TEST_F(SplatTest, NeedlesAreShortenedAndCounted) {
  Specimen body = cube(0.05, 0.4);
  body.move(Vec3d(30.0, 1.0, 1.0).asDiagonal(), Vec3d::Zero());
  capture::Splats rest = some_splats(0);
  for (auto& q : rest.rotations) q.setIdentity();
  rest.scales[0] = Vec3f(1.0F, 0.01F, 0.01F);  // a needle of the artist's own: ratio 100
  const capture::MeshBinding binding(means_of(rest), body.rest, 0.05, {}, arena_);
  SplatReport report;
  const capture::Splats moved = transport(rest, binding, body.view(), {}, arena_, &report);
  EXPECT_EQ(report.needles, rest.size());
  EXPECT_NEAR(moved.scales[0][0], 1.0F, 0.01F) << "no longer than it was, beside its width";
  for (std::size_t i = 1; i < rest.size(); ++i) {
    EXPECT_NEAR(moved.scales[i][0], 0.2F, 1e-4F) << "ten times the second axis, 0.02";
    EXPECT_NEAR(moved.scales[i][1], 0.02F, 1e-5F);
  }
}

TEST_F(SplatTest, StandardLayoutReadByNumpy) {
  Specimen body = cube(0.05, 0.4);
  const capture::Splats rest = some_splats(3);
  const capture::MeshBinding binding(means_of(rest), body.rest, 0.05, {}, arena_);
  write_splat_frame(folder_ / "splat.ply", rest, binding, body.view(), {}, arena_);
  std::string skip;
  const std::string text = run_python(folder_, "numpy", R"(
import numpy as np
raw = open('splat.ply', 'rb').read()
end = raw.index(b'end_header\n') + 11
names = [l.split()[2] for l in raw[:end].decode().splitlines() if l.startswith('property')]
a = np.frombuffer(raw[end:], '<f4').reshape(-1, len(names))
col = {n: a[:, i] for i, n in enumerate(names)}
rest = [n for n in names if n.startswith('f_rest_')]
print(len(a), len(rest), len(names) - len(rest) >= 14)
print(all(n in col for n in ['x','y','z','f_dc_0','opacity','scale_2','rot_3']))
print(np.allclose(np.sort(np.exp(col['scale_0'])), .01, atol=1e-6))
print(np.allclose(1 / (1 + np.exp(-col['opacity'])), .3 + .02 * np.arange(30), atol=1e-5))
print('%.5f %.5f' % (col['f_rest_0'][4], col['f_rest_15'][4]))
)",
                                      skip);
  if (!skip.empty()) GTEST_SKIP() << skip;
  char expected[64];
  // Channel-major: f_rest_0 is coefficient 1 of red, f_rest_15 coefficient 1 of green.
  std::snprintf(expected, sizeof expected, "%.5f %.5f", static_cast<double>(rest.sh[4 * 48 + 3]),
                static_cast<double>(rest.sh[4 * 48 + 4]));
  EXPECT_EQ(text, "30 45 True\nTrue\nTrue\nTrue\n" + std::string(expected) + "\n");
}

TEST_F(SplatTest, RefusesABindingOfOtherPoints) {
  const Specimen body = cube(0.1, 0.4);
  const capture::Splats rest = some_splats(0);
  const std::vector<Vec3d> two(2, Vec3d::Zero());
  const capture::MeshBinding binding(two, body.rest, 0.1, {}, arena_);
  EXPECT_NE(message_of(ErrorKind::kInput,
                       [&] { (void)transport(rest, binding, body.view(), {}, arena_); })
                .find("2 points"),
            std::string::npos);
}

}  // namespace
}  // namespace matterfit::bake
