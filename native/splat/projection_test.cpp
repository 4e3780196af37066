// SPDX-License-Identifier: GPL-3.0-or-later
// The projection and its adjoint in double: against the formula written down plainly, and against
// fourth-order differences.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "splat/dense_reference_for_test.hpp"
#include "splat/projection-inl.hpp"
#include "splat/scene_for_test.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

using splat::Camera;
using splat::RenderOptions;
using splat::View;
using Vector = Eigen::VectorXd;

GaussianShape<double> shape_of(const Vector& p) {
  GaussianShape<double> shape{};
  for (int k = 0; k < 3; ++k) {
    shape.mean[k] = p[k];
    shape.log_scale[k] = p[3 + k];
  }
  for (int k = 0; k < 4; ++k) shape.rotation[k] = p[6 + k];
  for (int k = 0; k < 9; ++k) shape.f[k / 3][k % 3] = p[11 + k];
  return shape;
}

struct Case {
  Vector parameters;  ///< dense_reference_for_test.hpp, harmonics of degree 3
  Camera camera;
  Vector bar;  ///< derivatives of the loss: mean 2, Σ₂ 3, opacity, colour 3, depth
};

std::vector<Case> cases() {
  std::mt19937 engine(3);
  std::vector<Case> all;
  const auto scene = splat::gaussians_for_test(6, 3, true);
  for (std::size_t i = 0; i < scene.size(); ++i) {
    Case item{splat::parameters_of(scene, i), splat::camera_for_test(80, 60), Vector(10)};
    // The last two lie so far aside that the Jacobian's directions are clamped.
    if (i >= 4) {
      item.camera.translation += Vec3d(i == 4 ? 3.0 : -3.0, 2.5, -1.0);
    }
    for (Eigen::Index k = 0; k < 10; ++k) {
      item.bar[k] = static_cast<double>(engine()) / 2147483648.0 - 1.0;
    }
    all.push_back(item);
  }
  return all;
}

TEST(Projection, IsTheFormula) {
  for (const Case& item : cases()) {
    const RenderOptions options;
    const View view(item.camera, options);
    Projection<double> at;
    project(shape_of(item.parameters), true, view, at);
    const splat::PlaneVector expected = splat::reference_projection(
        item.parameters, 3, Eigen::Matrix<double, 6, 1>::Zero(), item.camera, options);
    const double got[6] = {at.mean[0],       at.mean[1],       at.covariance[0],
                           at.covariance[1], at.covariance[2], at.depth};
    const int rows[6] = {0, 1, 2, 3, 4, 9};
    for (int k = 0; k < 6; ++k) {
      EXPECT_NEAR(got[k], expected[rows[k]], 1e-12 * std::max(1.0, std::abs(expected[rows[k]])));
    }
    const double determinant = expected[2] * expected[4] - expected[3] * expected[3];
    EXPECT_NEAR(at.determinant, determinant, 1e-12 * expected[2] * expected[4]);
  }
}

TEST(Projection, ThinFootprintsKeepTheirDeterminant) {
  // A thread 1e6 times as long as it is thick, across the view: the product of the variances.
  Vector p = cases()[0].parameters;
  p.segment<3>(0).setZero();
  p.segment<3>(3) = Vec3d(0.0, std::log(1e-6), std::log(1e-6));
  p.segment<4>(6) = Eigen::Vector4d(std::cos(0.4), 0.0, 0.0, std::sin(0.4));
  for (int k = 0; k < 9; ++k) p[11 + k] = k % 4 == 0 ? 1.0 : 0.0;
  Camera camera = splat::camera_for_test(80, 60);
  camera.fx = camera.fy = 100.0;
  camera.rotation = Mat3d::Identity();
  camera.translation = Vec3d(0.0, 0.0, 1.0);
  Projection<double> at;
  project(shape_of(p), true, View(camera, {.blur = 0.0}), at);
  EXPECT_NEAR(at.determinant, 1e8 * 1e-12, 1e-4 * 1e-12);
}

TEST(Projection, AdjointIsThatOfFourthOrderDifferences) {
  for (const Case& item : cases()) {
    RenderOptions options;
    options.antialiased = true;
    const View view(item.camera, options);
    const GaussianShape<double> shape = shape_of(item.parameters);
    Projection<double> at;
    project(shape, true, view, at);
    ProjectionAdjoint<double> bar{};
    for (int k = 0; k < 2; ++k) bar.mean[k] = item.bar[k];
    for (int k = 0; k < 3; ++k) bar.covariance[k] = item.bar[2 + k];
    bar.depth = item.bar[9];
    const double sharpness = std::sqrt(at.sharp / at.determinant);
    sharpness_adjoint(view, at, item.bar[5] * item.parameters[10] * sharpness, bar);
    ShapeAdjoint<double> got{};
    project_adjoint(shape, true, view, at, bar, got);
    double direction[3];
    const double distance = direction_of(shape.mean, view, direction);
    double y[16];
    sh_basis(3, direction, y);
    double y_bar[16] = {};
    Vector gradient = Vector::Zero(20 + 48 + 6);
    for (int band = 0; band < 16; ++band) {
      for (int c = 0; c < 3; ++c) {
        double colour = 0.5;
        for (int k = 0; k < 16; ++k) colour += item.parameters[20 + 3 * k + c] * y[k];
        const double colour_bar = colour < 0.0 ? 0.0 : item.bar[6 + c];
        gradient[20 + 3 * band + c] = colour_bar * y[band];
        y_bar[band] += colour_bar * item.parameters[20 + 3 * band + c];
      }
    }
    double d_bar[3];
    sh_basis_adjoint(3, direction, y_bar, d_bar);
    direction_adjoint(direction, distance, d_bar, view, got);
    for (int k = 0; k < 3; ++k) {
      gradient[k] = got.mean[k];
      gradient[3 + k] = got.log_scale[k];
    }
    for (int k = 0; k < 4; ++k) gradient[6 + k] = got.rotation[k];
    gradient[10] = item.bar[5] * sharpness;
    for (int k = 0; k < 9; ++k) gradient[11 + k] = got.f[k / 3][k % 3];
    for (int k = 0; k < 6; ++k) gradient[68 + k] = got.pose[k];

    Vector all(74);
    all << item.parameters, Vector::Zero(6);
    const auto loss = [&](Eigen::Index k, double step) {
      Vector moved = all;
      moved[k] += step;
      const Eigen::Matrix<double, 6, 1> pose = moved.tail<6>();
      return item.bar.dot(
          splat::reference_projection(moved.head(68), 3, pose, item.camera, options));
    };
    constexpr double kStep = 1e-3;
    for (Eigen::Index k = 0; k < 74; ++k) {
      const double expected =
          (8.0 * (loss(k, kStep) - loss(k, -kStep)) - (loss(k, 2 * kStep) - loss(k, -2 * kStep))) /
          (12.0 * kStep);
      const double size = gradient.segment(k < 68 ? 0 : 68, k < 68 ? 68 : 6).cwiseAbs().maxCoeff();
      EXPECT_NEAR(gradient[k], expected, 1e-6 * (std::abs(expected) + 1e-3 * size)) << k;
    }
  }
}

TEST(Harmonics, AreTheDefinitionAndOrthonormal) {
  // Gauss–Legendre in z by 4 points and 8 angles integrate polynomials of degree 6 exactly.
  const double nodes[4] = {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                           0.8611363115940526};
  const double weights[4] = {0.3478548451374538, 0.6521451548625461, 0.6521451548625461,
                             0.3478548451374538};
  double products[16][16] = {};
  for (int a = 0; a < 4; ++a) {
    for (int b = 0; b < 8; ++b) {
      const double r = std::sqrt(1.0 - nodes[a] * nodes[a]);
      const double angle = (b + 0.3) * std::numbers::pi / 4.0;
      const double d[3] = {r * std::cos(angle), r * std::sin(angle), nodes[a]};
      double y[16];
      sh_basis(3, d, y);
      const auto expected = splat::reference_harmonics(Vec3d(d[0], d[1], d[2]));
      for (std::size_t i = 0; i < 16; ++i) {
        EXPECT_NEAR(y[i], expected[i], 1e-13) << i;
        for (std::size_t j = 0; j < 16; ++j) {
          products[i][j] += weights[a] * std::numbers::pi / 4.0 * y[i] * y[j];
        }
      }
    }
  }
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) EXPECT_NEAR(products[i][j], i == j ? 1.0 : 0.0, 1e-12);
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
