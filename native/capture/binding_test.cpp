// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/binding.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.hpp"
#include "base/message_for_test.hpp"
#include "capture/specimens_for_test.hpp"

namespace matterfit::capture {
namespace {

using namespace test_bodies;

struct Affine {
  Mat3d a;
  Vec3d b;
  Mat3d w;
};

Affine some_motion() {
  Affine motion;
  motion.a << 0.7, -0.6, 0.2, 0.5, 1.2, 0.0, -0.3, 0.1, 1.4;
  motion.b = Vec3d(3.0, -2.0, 5.0);
  motion.w << 0.0, -3.0, 1.0, 3.0, 0.5, 0.0, -1.0, 0.0, -0.2;
  return motion;
}

/// Random points in a cube, inside and outside the body.
std::vector<Vec3d> scatter(std::size_t count, double half) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-half, half);
  std::vector<Vec3d> points(count);
  for (Vec3d& p : points) p = Vec3d(uniform(random), uniform(random), uniform(random));
  return points;
}

class BindingModes : public ::testing::TestWithParam<BindingGradient> {
 protected:
  void SetUp() override { body_.move(motion_.a, motion_.b, motion_.w); }
  [[nodiscard]] MeshBinding bind(const std::vector<Vec3d>& points, Arena& arena) const {
    BindingOptions options;
    options.gradient = GetParam();
    return {points, body_.rest, body_.separation, options, arena};
  }
  const Affine motion_ = some_motion();
  Specimen body_ = ball(0.05, 0.4);
};

// x = A X + b is reproduced to float rounding inside, on and outside the body, and so are F and an
// affine velocity field.
TEST_P(BindingModes, ReproduceAffineMotion) {
  const auto points = scatter(500, 0.5);
  Arena arena(2);
  const MeshBinding binding = bind(points, arena);
  const auto x = binding.positions(body_.view(), arena);
  const auto v = binding.velocities(body_.view(), arena);
  const auto f = binding.deformation_gradients(body_.view(), arena);
  std::size_t fits = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d expected = motion_.a * points[i] + motion_.b;
    EXPECT_LT((x[i] - expected).norm(), 1e-5) << i;
    EXPECT_LT((f[i] - motion_.a).norm(), 1e-4) << i;
    const bool fitted = !binding.stencil(i).fitted.empty();
    fits += fitted ? 1 : 0;
    if (fitted) {
      EXPECT_LT((v[i] - motion_.w * expected).norm(), 1e-4) << i;
    }
    if (points[i].norm() < 0.4) {
      EXPECT_TRUE(fitted) << "inside there is always a fit, " << i;
    }
  }
  EXPECT_GT(fits, 150U);
}

/// Σ of cotangents times what they are of.
double weighed(const ParticleView& state, const std::vector<Vec3d>& of_position,
               const std::vector<Mat3d>& of_gradient) {
  double sum = 0.0;
  for (std::size_t p = 0; p < of_position.size(); ++p) {
    sum += of_position[p].dot(state.positions[p].cast<double>()) +
           of_gradient[p].cwiseProduct(state.deformation_gradients[p].cast<double>()).sum();
  }
  return sum;
}

// Positions are linear in the particles' positions and F.
TEST_P(BindingModes, SpreadIsTheTranspose) {
  const auto points = scatter(300, 0.5);
  Arena arena(1);
  const MeshBinding binding = bind(points, arena);
  const auto x = binding.positions(body_.view(), arena);
  std::vector<Vec3d> bar(points.size());
  double expected = 0.0;
  for (std::size_t i = 0; i < bar.size(); ++i) {
    bar[i] = Vec3d(std::sin(double(i)), std::cos(2.0 * double(i)), std::sin(0.3 * double(i)));
    expected += bar[i].dot(x[i]);
  }
  std::vector<Vec3d> of_position(binding.particles(), Vec3d::Zero());
  std::vector<Mat3d> of_gradient(binding.particles(), Mat3d::Zero());
  binding.spread(bar, of_position, of_gradient);
  EXPECT_NEAR(weighed(body_.view(), of_position, of_gradient), expected,
              1e-10 * std::abs(expected));
  EXPECT_THROW(binding.spread(bar, {of_position.data(), 3}, of_gradient), Error);
}

TEST_P(BindingModes, SpreadGradientsIsTheTranspose) {
  const auto points = scatter(300, 0.5);
  Arena arena(1);
  const MeshBinding binding = bind(points, arena);
  const auto f = binding.deformation_gradients(body_.view(), arena);
  std::vector<Mat3d> bar(points.size());
  double expected = 0.0;
  for (std::size_t i = 0; i < bar.size(); ++i) {
    for (int k = 0; k < 9; ++k) bar[i](k / 3, k % 3) = std::sin(double(i) + 0.7 * k);
    expected += bar[i].cwiseProduct(f[i]).sum();
  }
  std::vector<Vec3d> of_position(binding.particles(), Vec3d::Zero());
  std::vector<Mat3d> of_gradient(binding.particles(), Mat3d::Zero());
  binding.spread_gradients(bar, of_position, of_gradient);
  EXPECT_NEAR(weighed(body_.view(), of_position, of_gradient), expected,
              1e-10 * std::abs(expected));
  EXPECT_THROW(binding.spread_gradients(bar, {of_position.data(), 3}, of_gradient), Error);
}

INSTANTIATE_TEST_SUITE_P(Both, BindingModes,
                         ::testing::Values(BindingGradient::kParticle, BindingGradient::kFitted));

// F of a plastic body is the elastic part; the fit follows the particles all the same.
TEST(Binding, FittedNeedsNoDeformationGradient) {
  Specimen body = cube(0.1, 0.5);
  const Affine motion = some_motion();
  body.move(motion.a, motion.b);
  for (Mat3f& f : body.deformation) f.setIdentity();
  Arena arena(1);
  BindingOptions options;
  options.gradient = BindingGradient::kFitted;
  const auto points = scatter(200, 0.55);
  const MeshBinding binding(points, body.rest, 0.1, options, arena);
  const auto x = binding.positions(body.view(), arena);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_LT((x[i] - (motion.a * points[i] + motion.b)).norm(), 1e-5);
  }
}

// Bending: x = (X + c X², …) is not affine; the error falls with h² in the interior.
TEST(Binding, ErrorOfABendIsOfSecondOrder) {
  Arena arena(2);
  const auto bend = [](const Vec3d& x) { return Vec3d(x[0], x[1], x[2] + 0.5 * x[0] * x[0]); };
  double previous = 0.0;
  for (const double h : {0.1, 0.05}) {
    Specimen body = cube(h, 0.5);
    for (std::size_t i = 0; i < body.rest.size(); ++i) {
      body.positions[i] = bend(body.rest[i]).cast<float>();
      body.deformation[i](2, 0) = static_cast<float>(body.rest[i][0]);
    }
    const auto points = scatter(300, 0.3);
    const MeshBinding binding(points, body.rest, h, {}, arena);
    const auto x = binding.positions(body.view(), arena);
    double worst = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      worst = std::max(worst, (x[i] - bend(points[i])).norm());
    }
    EXPECT_LT(worst, 0.5 * h * h);
    if (previous > 0.0) {
      EXPECT_LT(worst, 0.3 * previous);
    }
    previous = worst;
  }
}

// Along a line from the bulk to far outside, the moved position varies without jumps.
TEST(Binding, IsContinuousFromInsideToFarOutside) {
  Specimen body = ball(0.05, 0.3);
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0.0F, 0.01F);
  for (Vec3f& x : body.positions) x += Vec3f(noise(random), noise(random), noise(random));
  std::vector<Vec3d> points;
  points.reserve(20000);
  for (int i = 0; i < 20000; ++i) points.push_back(i * 5e-5 * Vec3d(0.8, 0.36, 0.48));
  Arena arena(2);
  const MeshBinding binding(points, body.rest, 0.05, {}, arena);
  const auto x = binding.positions(body.view(), arena);
  for (std::size_t i = 1; i < x.size(); ++i) {
    EXPECT_LT((x[i] - x[i - 1]).norm(), 3e-4) << i;
    EXPECT_LE(binding.stencil(i).particles.size(), 64U);
  }
  EXPECT_EQ(binding.farthest().point, points.size() - 1);
  EXPECT_NEAR(binding.farthest().distance, 0.7, 0.05);
  EXPECT_GT(binding.count_beyond(0.1), 10000U);
  EXPECT_EQ(binding.count_beyond(1.0), 0U);
}

TEST(Binding, SameBitsForAnyNumberOfThreads) {
  Specimen body = ball(0.05, 0.4);
  const Affine motion = some_motion();
  body.move(motion.a, motion.b, motion.w);
  const auto points = scatter(1000, 0.5);
  Arena one(1);
  Arena two(2);
  const MeshBinding a(points, body.rest, 0.05, {}, one);
  const MeshBinding b(points, body.rest, 0.05, {}, two);
  const auto xa = a.positions(body.view(), one);
  const auto xb = b.positions(body.view(), two);
  for (std::size_t i = 0; i < points.size(); ++i) ASSERT_EQ(xa[i], xb[i]);
}

TEST(Binding, RefusesWhatCannotBeBound) {
  Arena arena(1);
  const std::vector<Vec3d> nothing;
  const std::vector<Vec3d> one{Vec3d::Zero()};
  message_of(ErrorKind::kInput, [&] { const MeshBinding b(one, nothing, 0.1, {}, arena); });
  const std::vector<Vec3d> bad{Vec3d(0.0, std::nan(""), 0.0)};
  EXPECT_NE(message_of(ErrorKind::kInput, [&] { const MeshBinding b(bad, one, 0.1, {}, arena); })
                .find("point 0"),
            std::string::npos);
  const MeshBinding b(one, one, 0.1, {}, arena);  // a single particle binds
  Specimen body = cube(0.1, 0.2);
  EXPECT_NE(
      message_of(ErrorKind::kInput, [&] { (void)b.positions(body.view(), arena); }).find("64"),
      std::string::npos);
}

TEST(Binding, AnswersCancel) {
  Arena arena(2);
  Interrupter interrupter;
  BindingOptions options;
  options.interrupter = &interrupter;
  const std::vector<Vec3d> points(1000, Vec3d(0.1, 0.2, 0.3));
  const std::vector<Vec3d> rest{Vec3d::Zero(), Vec3d::UnitX(), Vec3d::UnitY(), Vec3d::UnitZ()};
  EXPECT_EQ(MeshBinding(points, rest, 1.0, options, arena).points(), 1000U);
  interrupter.cancel();
  try {
    const MeshBinding binding(points, rest, 1.0, options, arena);
    FAIL() << "it was bound in spite of Cancel";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCancelled) << error.what();
  }
}

TEST(Binding, LocalSpaceIsTheObjects) {
  Eigen::Affine3d object = Eigen::Translation3d(1.0, 2.0, 3.0) *
                           Eigen::AngleAxisd(0.7, Vec3d(1, 2, 2).normalized()) *
                           Eigen::Scaling(2.0, 0.5, 1.0);
  const std::vector<Vec3d> world{object * Vec3d(0.1, -0.2, 0.3)};
  EXPECT_LT((to_local(world, object)[0] - Vec3f(0.1F, -0.2F, 0.3F)).norm(), 1e-6F);
}

}  // namespace
}  // namespace matterfit::capture
