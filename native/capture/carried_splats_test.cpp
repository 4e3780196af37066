// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/carried_splats.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "capture/spherical_harmonics.hpp"

namespace matterfit::capture {
namespace {

Mat3d turned_about(const Vec3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  return angle > 0.0 ? Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix()
                     : Mat3d(Mat3d::Identity());
}

/// The rotation vector of R' Rᵀ, both near each other.
Vec3d rotation_between(const Mat3d& before, const Mat3d& after) {
  const Eigen::AngleAxisd turn(after * before.transpose());
  return turn.angle() * turn.axis();
}

TEST(CarriedSplats, RotationOfFGoesBack) {
  Mat3d f;
  f << 1.2, 0.3, -0.2, -0.1, 0.8, 0.4, 0.5, -0.3, 1.1;
  Mat3d direction;
  direction << 0.4, -0.7, 0.2, 0.9, 0.1, -0.5, -0.3, 0.6, 0.8;
  const Vec3d bar(0.7, -1.1, 0.4);
  for (const double sign : {1.0, -1.0}) {  // inverted too
    f.col(2) *= sign;
    constexpr double kStep = 1e-5;
    const Mat3d at = polar_rotation(f);
    const double difference = bar.dot(rotation_between(polar_rotation(f - kStep * direction),
                                                       polar_rotation(f + kStep * direction))) /
                              (2.0 * kStep);
    const double exact = polar_rotation_adjoint(f, bar).cwiseProduct(direction).sum();
    EXPECT_NEAR(exact, difference, 1e-8 * std::abs(difference)) << at;
  }
  EXPECT_EQ(polar_rotation_adjoint(Mat3d::Zero(), bar), Mat3d(Mat3d::Zero()));
}

TEST(CarriedSplats, TurnedColoursGoBack) {
  for (int degree = 1; degree <= kMaxShDegree; ++degree) {
    const std::size_t count = 3 * splat::sh_bands(degree);
    std::vector<float> turned(count);
    std::vector<float> bar(count);
    for (std::size_t k = 0; k < count; ++k) {
      turned[k] = std::sin(0.7F * float(k) + 0.2F);
      bar[k] = std::cos(1.3F * float(k));
    }
    for (int axis = 0; axis < 3; ++axis) {
      constexpr double kStep = 0.02;
      const auto weighed = [&](double angle) {
        std::vector<float> moved = turned;
        ShRotation(turned_about(angle * Vec3d::Unit(axis))).apply(moved, degree);
        double sum = 0.0;
        for (std::size_t k = 0; k < count; ++k) sum += double(bar[k]) * double(moved[k]);
        return sum;
      };
      const double difference = (weighed(-2.0 * kStep) - 8.0 * weighed(-kStep) +
                                 8.0 * weighed(kStep) - weighed(2.0 * kStep)) /
                                (12.0 * kStep);
      EXPECT_NEAR(ShRotation::spin_bar(turned, bar, degree)[axis], difference, 5e-5)
          << degree << " " << axis;
    }
  }
}

/// Against differences in the particles' F and places, of Gaussians that are rounded to float.
TEST(CarriedSplats, GoBackToTheParticles) {
  mpm::Body body;
  body.name = "body";
  for (int i = 0; i < 64; ++i) body.rest.emplace_back(0.1 * Vec3d(i % 4, (i / 4) % 4, i / 16));
  Splats rest;
  rest.sh_degree = 2;
  for (int i = 0; i < 20; ++i) {
    const auto at = float(i);
    rest.means.emplace_back(0.15F + 0.1F * std::sin(at), 0.15F + 0.1F * std::cos(1.7F * at),
                            0.15F + 0.1F * std::sin(0.6F * at));
    rest.rotations.push_back(Eigen::Quaternionf::Identity());
    rest.scales.emplace_back(0.02F, 0.02F, 0.02F);
    rest.opacities.push_back(0.5F);
    for (std::size_t k = 0; k < 3 * rest.sh_bands(); ++k) {
      rest.sh.push_back(std::sin(0.3F * at + float(k)));
    }
  }
  Arena arena(2);
  for (const auto law : {material::Law::kNeoHookean, material::Law::kVonMises}) {
    body.material.law = law;
    const CarriedSplats carried(rest, body, 0.1, arena);
    // One more degree than the splats have, and Gaussians of others before them.
    constexpr int kDegree = 3;
    constexpr std::size_t kFirst = 2;
    const std::size_t stride = 3 * splat::sh_bands(kDegree);
    splat::GaussianGradients bar;
    for (std::size_t i = 0; i < kFirst + carried.size(); ++i) {
      const auto at = float(i);
      bar.means.emplace_back(std::sin(at), std::cos(at), std::sin(2.0F * at));
      Mat3f& f = bar.deformation_gradients.emplace_back();
      for (int k = 0; k < 9; ++k) f(k / 3, k % 3) = 0.1F * std::cos(at + float(k));
      for (std::size_t k = 0; k < stride; ++k) {
        bar.sh.push_back(0.2F * std::sin(at + 0.5F * float(k)));
      }
    }
    const auto direction = [](std::size_t p) {
      const double t = 0.1 * double(p);
      return Vec3d(std::sin(t), std::cos(1.3 * t), std::sin(0.7 * t + 1.0));
    };
    std::vector<Vec3f> positions(body.rest.size());
    std::vector<Mat3f> gradients(body.rest.size());
    const auto state = [&](double by) {
      for (std::size_t p = 0; p < body.rest.size(); ++p) {
        positions[p] = (body.rest[p] + 0.05 * direction(3 * p) + by * direction(p)).cast<float>();
        Mat3d f = turned_about(Vec3d(0.4, -0.3, 0.2));
        for (int k = 0; k < 3; ++k) f.col(k) += (0.1 + by) * direction(p + 11 * std::size_t(k));
        gradients[p] = f.cast<float>();
      }
      ParticleView view;
      view.name = body.name;
      view.positions = positions;
      view.deformation_gradients = gradients;
      view.separation = 0.1;
      return view;
    };
    const auto weighed = [&](double by) {
      const splat::Gaussians now = carried.at(state(by), arena);
      const std::size_t own = 3 * rest.sh_bands();
      double sum = 0.0;
      for (std::size_t i = 0; i < now.size(); ++i) {
        sum += double(bar.means[kFirst + i].dot(now.means[i]));
        sum += double(
            bar.deformation_gradients[kFirst + i].cwiseProduct(now.deformation_gradients[i]).sum());
        for (std::size_t k = 0; k < own; ++k) {
          sum += double(bar.sh[stride * (kFirst + i) + k]) * double(now.sh[own * i + k]);
        }
      }
      return sum;
    };
    std::vector<Vec3d> of_position(body.rest.size(), Vec3d::Zero());
    std::vector<Mat3d> of_gradient(body.rest.size(), Mat3d::Zero());
    carried.add_bars(state(0.0), bar, kFirst, kDegree, of_position, of_gradient, arena);
    double exact = 0.0;
    for (std::size_t p = 0; p < body.rest.size(); ++p) {
      exact += of_position[p].dot(direction(p));
      for (int k = 0; k < 3; ++k) {
        exact += of_gradient[p].col(k).dot(direction(p + 11 * std::size_t(k)));
      }
    }
    constexpr double kStep = 5e-3;
    const double difference = (weighed(-2.0 * kStep) - 8.0 * weighed(-kStep) +
                               8.0 * weighed(kStep) - weighed(2.0 * kStep)) /
                              (12.0 * kStep);
    EXPECT_GT(std::abs(difference), 0.1);
    EXPECT_NEAR(exact, difference, 1e-3 * std::abs(difference));
  }
}

}  // namespace
}  // namespace matterfit::capture
