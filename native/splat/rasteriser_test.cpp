// SPDX-License-Identifier: GPL-3.0-or-later
#include "splat/rasteriser.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "splat/dense_reference_for_test.hpp"
#include "splat/scene_for_test.hpp"

namespace matterfit::splat {
namespace {

using ::testing::HasSubstr;

constexpr int kWidth = 70;
constexpr int kHeight = 53;
/// Pixels that come nearer than this to a decision may decide otherwise in single precision.
constexpr double kDecision = 1e-5;

struct Case {
  std::string name;
  int sh_degree;
  bool deformed;
  double blur;
  bool antialiased;
  SimdTarget target;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  const std::vector<std::pair<std::string, SimdTarget>> targets = {
      {"sse4", SimdTarget::kSse4}, {"avx2", SimdTarget::kAvx2}, {"avx512", SimdTarget::kAvx512}};
  for (const auto& [name, target] : targets) {
    all.push_back({name + "_colour", 0, false, 0.3, false, target});
    all.push_back({name + "_harmonics_deformed", 3, true, 0.3, false, target});
    all.push_back({name + "_no_blur", 1, true, 0.0, false, target});
    all.push_back({name + "_antialiased", 0, true, 0.3, true, target});
  }
  return all;
}

class RasteriserCase : public ::testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    try {
      rasteriser_ = std::make_unique<Rasteriser>(std::make_shared<Arena>(2), GetParam().target);
    } catch (const Error& error) {
      GTEST_SKIP() << error.what();
    }
    scene_ = gaussians_for_test(300, GetParam().sh_degree, GetParam().deformed);
    camera_ = camera_for_test(kWidth, kHeight);
    options_.blur = GetParam().blur;
    options_.antialiased = GetParam().antialiased;
  }
  std::unique_ptr<Rasteriser> rasteriser_;
  Gaussians scene_;
  Camera camera_;
  RenderOptions options_;
};

INSTANTIATE_TEST_SUITE_P(Targets, RasteriserCase, ::testing::ValuesIn(cases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(RasteriserCase, ImageIsThatOfTheDenseDoubleLoop) {
  const Image& image = rasteriser_->render(scene_, camera_, options_);
  const DenseImage expected = DenseReference(scene_, camera_, options_).render();
  double worst = 0.0;
  double covered = 0.0;
  std::size_t undecided = 0;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    covered += expected.mask[i];
    if (expected.margin[i] < kDecision) {
      ++undecided;
      continue;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t k = c * image.pixels() + i;
      worst = std::max(worst, std::abs(static_cast<double>(image.colour[k]) - expected.colour[k]));
    }
    worst = std::max(worst, std::abs(static_cast<double>(image.mask[i]) - expected.mask[i]));
    worst = std::max(worst, std::abs(static_cast<double>(image.depth[i]) - expected.depth[i]));
  }
  EXPECT_LT(worst, 5e-6);
  EXPECT_GT(covered, 0.1 * static_cast<double>(image.pixels()));
  EXPECT_LT(undecided, image.pixels() / 50);
  RecordProperty("worst", std::to_string(worst));
}

/// Largest difference of all rows, relative to the largest expected number.
struct Compared {
  double difference = 0.0;
  double size = 0.0;
  void add(double value, double expected) {
    difference = std::max(difference, std::abs(value - expected));
    size = std::max(size, std::abs(expected));
  }
  void expect(const char* what) const {
    EXPECT_GT(size, 0.0) << what;
    EXPECT_LT(difference, 2e-5 * size) << what << ": " << difference / size;
  }
};

TEST_P(RasteriserCase, GradientsAreThoseOfTheDenseDoubleLoop) {
  const DenseReference reference(scene_, camera_, options_);
  Image loss = loss_for_test(kWidth, kHeight);
  const DenseImage expected_image = reference.render();
  for (std::size_t i = 0; i < loss.pixels(); ++i) {
    if (expected_image.margin[i] >= kDecision) continue;
    for (std::size_t c = 0; c < 3; ++c) loss.colour[c * loss.pixels() + i] = 0.0F;
    loss.mask[i] = loss.depth[i] = 0.0F;
  }
  GaussianGradients got;
  rasteriser_->render(scene_, camera_, options_);
  rasteriser_->backward(scene_, loss, got);
  Eigen::Matrix<double, 6, 1> pose;
  const auto expected = reference.gradients(loss, pose);
  Compared mean;
  Compared scale;
  Compared rotation;
  Compared opacity;
  Compared sh;
  Compared f;
  Compared poses;
  const std::size_t coefficients = 3 * sh_bands(scene_.sh_degree);
  for (std::size_t i = 0; i < scene_.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      mean.add(static_cast<double>(got.means[i][k]), expected[i][k]);
      scale.add(static_cast<double>(got.log_scales[i][k]), expected[i][3 + k]);
    }
    for (int k = 0; k < 4; ++k) {
      rotation.add(static_cast<double>(got.rotations[i][k]), expected[i][6 + k]);
    }
    opacity.add(static_cast<double>(got.opacities[i]), expected[i][10]);
    for (std::size_t k = 0; k < coefficients; ++k) {
      sh.add(static_cast<double>(got.sh[i * coefficients + k]),
             expected[i][kShapeParameters + static_cast<Eigen::Index>(k)]);
    }
    if (GetParam().deformed) {
      for (int k = 0; k < 9; ++k) {
        f.add(static_cast<double>(got.deformation_gradients[i](k / 3, k % 3)), expected[i][11 + k]);
      }
    }
  }
  for (std::size_t k = 0; k < 6; ++k) poses.add(got.pose[k], pose[static_cast<Eigen::Index>(k)]);
  mean.expect("mean");
  scale.expect("log scale");
  rotation.expect("rotation");
  opacity.expect("opacity");
  sh.expect("harmonics");
  poses.expect("pose");
  if (GetParam().deformed) f.expect("deformation gradient");
  EXPECT_EQ(got.deformation_gradients.empty(), !GetParam().deformed);
}

TEST(Rasteriser, SameBitsOnAnyNumberOfThreads) {
  // More Gaussians than a chunk, on planes, where depths are equal.
  Gaussians scene = gaussians_for_test(3000, 2, true);
  Camera camera = camera_for_test(150, 101);
  camera.rotation = Mat3d::Identity();
  for (Vec3f& mean : scene.means) mean.z() = std::round(mean.z() * 4.0F) / 4.0F;
  const Image loss = loss_for_test(camera.width, camera.height);
  Image first;
  GaussianGradients first_gradients;
  for (const int threads : {1, 2, 8}) {
    Rasteriser rasteriser(std::make_shared<Arena>(threads));
    // A call before, of another size: what memory holds must not matter.
    rasteriser.render(gaussians_for_test(700, 0, false), camera_for_test(64, 40));
    const Image image = rasteriser.render(scene, camera);
    GaussianGradients gradients;
    rasteriser.backward(scene, loss, gradients);
    if (threads == 1) {
      first = image;
      first_gradients = gradients;
      continue;
    }
    EXPECT_EQ(image.colour, first.colour) << threads;
    EXPECT_EQ(image.mask, first.mask) << threads;
    EXPECT_EQ(image.depth, first.depth) << threads;
    EXPECT_EQ(gradients.means, first_gradients.means) << threads;
    EXPECT_EQ(gradients.log_scales, first_gradients.log_scales) << threads;
    EXPECT_EQ(gradients.rotations, first_gradients.rotations) << threads;
    EXPECT_EQ(gradients.opacities, first_gradients.opacities) << threads;
    EXPECT_EQ(gradients.sh, first_gradients.sh) << threads;
    EXPECT_EQ(gradients.deformation_gradients, first_gradients.deformation_gradients) << threads;
    EXPECT_EQ(gradients.pose, first_gradients.pose) << threads;
  }
}

/// One round Gaussian that a camera at the origin sees at pixel coordinates (x, y), 2 m away.
Gaussians one_at(const Camera& camera, double x, double y, double scale, float opacity) {
  Gaussians g;
  g.means.emplace_back(
      Vec3d((x - camera.cx) / camera.fx * 2.0, (y - camera.cy) / camera.fy * 2.0, 2.0)
          .cast<float>());
  g.log_scales.push_back(Vec3f::Constant(static_cast<float>(std::log(scale))));
  g.rotations.emplace_back(1.0F, 0.0F, 0.0F, 0.0F);
  g.opacities.push_back(opacity);
  g.sh = {1.0F, 0.0F, -1.0F};
  return g;
}

Camera plain_camera() {
  Camera camera;
  camera.width = 40;
  camera.height = 30;
  camera.fx = camera.fy = 50.0;
  camera.cx = 20.0;
  camera.cy = 15.0;
  return camera;
}

TEST(Rasteriser, APixelIsSampledAtItsCentre) {
  const Camera camera = plain_camera();
  const Image image = render(one_at(camera, 10.5, 7.5, 0.02, 0.8F), camera, {}, 1);
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * camera.width + x); };
  const std::size_t centre = at(10, 7);
  EXPECT_NEAR(image.mask[centre], 0.8, 1e-6);
  EXPECT_NEAR(image.depth[centre], 1.6, 1e-6);
  EXPECT_NEAR(image.colour[centre], 0.8 * (0.5 + 0.28209479177387814), 1e-6);
  EXPECT_NEAR(image.colour[image.pixels() + centre], 0.4, 1e-6);
  // One pixel aside: Σ₂ = (50/2 · 0.02)² (I + r rᵀ) + 0.3 I, since J = 50/2 (I, −r) with the mean's
  // direction r = (t_x/t_z, t_y/t_z).
  const Eigen::Vector2d r((10.5 - 20.0) / 50.0, (7.5 - 15.0) / 50.0);
  const Eigen::Matrix2d identity = Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d conic = (0.25 * (identity + r * r.transpose()) + 0.3 * identity).inverse();
  for (const int step : {-1, 1}) {
    EXPECT_NEAR(image.mask[at(10 + step, 7)], 0.8 * std::exp(-0.5 * conic(0, 0)), 1e-6);
    EXPECT_NEAR(image.mask[at(10, 7 + step)], 0.8 * std::exp(-0.5 * conic(1, 1)), 1e-6);
    EXPECT_NEAR(image.mask[at(10 + step, 7 + step)], 0.8 * std::exp(-0.5 * conic.sum()), 1e-6);
  }
}

TEST(Rasteriser, AColourCutOffAtZeroHasNoGradient) {
  const Camera camera = plain_camera();
  Rasteriser rasteriser(std::make_shared<Arena>(1));
  Gaussians g = one_at(camera, 10.5, 7.5, 0.02, 0.8F);
  constexpr double kY0 = 0.28209479177387814;
  const auto coefficient = [](double colour) { return static_cast<float>((colour - 0.5) / kY0); };
  g.sh = {coefficient(1e-4), coefficient(-1e-4), coefficient(-0.3)};
  const std::size_t centre = 7 * 40 + 10;
  Image loss(camera.width, camera.height);
  for (std::size_t c = 0; c < 3; ++c) loss.colour[c * loss.pixels() + centre] = 1.0F;
  const Image& image = rasteriser.render(g, camera);
  EXPECT_NEAR(image.colour[centre], 0.8e-4, 1e-6);
  EXPECT_EQ(image.colour[image.pixels() + centre], 0.0F);
  EXPECT_EQ(image.colour[2 * image.pixels() + centre], 0.0F);
  GaussianGradients gradients;
  rasteriser.backward(g, loss, gradients);
  EXPECT_NEAR(gradients.sh[0], 0.8 * kY0, 1e-6);
  EXPECT_EQ(gradients.sh[1], 0.0F);
  EXPECT_EQ(gradients.sh[2], 0.0F);
}

TEST(Rasteriser, NearerOnesHideThoseBehindAndTiesGoByIndex) {
  const Camera camera = plain_camera();
  Gaussians g = one_at(camera, 10.5, 7.5, 0.05, 0.5F);
  const Gaussians other = one_at(camera, 10.5, 7.5, 0.05, 0.5F);
  g.means.push_back(other.means[0]);
  g.log_scales.push_back(other.log_scales[0]);
  g.rotations.push_back(other.rotations[0]);
  g.opacities.push_back(0.5F);
  g.sh.insert(g.sh.end(), {0.0F, 1.0F, 0.0F});
  const std::size_t centre = 7 * 40 + 10;
  const double first = 0.5 + 0.28209479177387814;
  Image image = render(g, camera, {}, 1);
  EXPECT_NEAR(image.colour[centre], 0.5 * first + 0.25 * 0.5, 1e-6);
  g.means[1] *= 0.9F;
  image = render(g, camera, {}, 1);
  EXPECT_NEAR(image.colour[centre], 0.5 * 0.5 + 0.25 * first, 1e-6);
}

TEST(Rasteriser, NothingToSeeGivesZeros) {
  const Camera camera = plain_camera();
  Rasteriser rasteriser(std::make_shared<Arena>(1));
  const Image loss = loss_for_test(camera.width, camera.height);
  Gaussians behind = one_at(camera, 10.5, 7.5, 0.02, 0.8F);
  behind.means[0].z() = -2.0F;
  Gaussians near = behind;
  near.means[0].z() = 0.005F;
  Gaussians aside = one_at(camera, -30.0, 7.5, 0.02, 0.8F);
  Gaussians faint = one_at(camera, 10.5, 7.5, 0.02, 0.003F);
  Gaussians clear = one_at(camera, 10.5, 7.5, 0.02, 0.0F);
  Gaussians at_eye = behind;
  at_eye.means[0].setZero();
  at_eye.sh_degree = 1;
  at_eye.sh.assign(12, 0.5F);
  for (const Gaussians& scene : {Gaussians(), behind, near, aside, faint, clear, at_eye}) {
    const Image& image = rasteriser.render(scene, camera);
    EXPECT_EQ(*std::max_element(image.mask.begin(), image.mask.end()), 0.0F);
    EXPECT_EQ(*std::max_element(image.colour.begin(), image.colour.end()), 0.0F);
    GaussianGradients gradients;
    rasteriser.backward(scene, loss, gradients);
    ASSERT_EQ(gradients.means.size(), scene.size());
    if (scene.size() > 0) {
      EXPECT_EQ(gradients.means[0], Vec3f::Zero());
      EXPECT_EQ(gradients.sh[0], 0.0F);
    }
    EXPECT_EQ(gradients.pose[5], 0.0);
  }
}

TEST(Rasteriser, WhatWasDrawnBeforeDoesNotStay) {
  const Camera camera = camera_for_test(80, 60);
  const Camera turned = camera_for_test(60, 80);  // as many tiles
  const Gaussians one = one_at(camera, 10.5, 7.5, 0.02, 0.8F);
  const Gaussians other = one_at(camera, 60.5, 45.5, 0.02, 0.8F);
  Rasteriser rasteriser(std::make_shared<Arena>(1));
  for (const Gaussians& scene : {one, other, Gaussians(), one, one, other}) {
    for (const Camera& view : {camera, camera, turned}) {
      const Image& image = rasteriser.render(scene, view);
      const Image fresh = render(scene, view, {}, 1);
      EXPECT_EQ(image.mask, fresh.mask);
      EXPECT_EQ(image.colour, fresh.colour);
      EXPECT_EQ(image.depth, fresh.depth);
    }
  }
}

TEST(Rasteriser, HugeAndDegenerateOnesAreDrawnAsTheFormulaSaysOrNotAtAll) {
  const Camera camera = plain_camera();
  Rasteriser rasteriser(std::make_shared<Arena>(1));
  const Image loss = loss_for_test(camera.width, camera.height);
  const auto finite = [](const GaussianGradients& g) {
    return g.means[0].allFinite() && g.log_scales[0].allFinite() && g.rotations[0].allFinite();
  };
  GaussianGradients gradients;
  // As large as a planet: the same everywhere.
  const Gaussians huge = one_at(camera, 10.5, 7.5, 1e6, 0.7F);
  Image image = rasteriser.render(huge, camera);
  for (const float value : image.mask) EXPECT_NEAR(value, 0.7, 1e-6);
  rasteriser.backward(huge, loss, gradients);
  EXPECT_TRUE(finite(gradients));
  // A point: the blur alone is seen; without it nothing is, or one pixel at most.
  Gaussians point = one_at(camera, 10.5, 7.5, 1.0, 0.7F);
  point.log_scales[0].setConstant(-200.0F);
  image = rasteriser.render(point, camera);
  EXPECT_NEAR(image.mask[7 * 40 + 11], 0.7 * std::exp(-0.5 / 0.3), 1e-5);
  rasteriser.backward(point, loss, gradients);
  EXPECT_TRUE(finite(gradients));
  image = rasteriser.render(point, camera, {.blur = 0.0});
  for (const float value : image.mask) EXPECT_TRUE(value >= 0.0F && value <= 0.7F);
  rasteriser.backward(point, loss, gradients);
  EXPECT_TRUE(finite(gradients));
  // A thread across the whole image, on the diagonal.
  Gaussians thread = one_at(camera, 20.0, 15.0, 1.0, 1.0F);
  thread.log_scales[0] = Vec3f(std::log(20.0F), -12.0F, -12.0F);
  thread.rotations[0] = Eigen::Vector4f(std::cos(0.3F), 0.0F, 0.0F, std::sin(0.3F));
  image = rasteriser.render(thread, camera);
  const DenseImage expected = DenseReference(thread, camera).render();
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    if (expected.margin[i] > kDecision) {
      EXPECT_NEAR(static_cast<double>(image.mask[i]), expected.mask[i], 5e-6) << i;
    }
  }
  // Scales that overflow even in double.
  Gaussians overflown = one_at(camera, 10.5, 7.5, 1.0, 0.7F);
  overflown.log_scales[0].setConstant(1000.0F);
  image = rasteriser.render(overflown, camera);
  for (const float value : image.mask) EXPECT_EQ(value, 0.0F);
}

template <class Call>
std::string message_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

TEST(Rasteriser, WhatCannotBeDrawnIsRefusedInWords) {
  const Camera camera = plain_camera();
  const Gaussians good = gaussians_for_test(5, 1, true);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto refuse = [&](const auto& spoil, const char* words) {
    Gaussians g = good;
    Camera c = camera;
    RenderOptions o;
    spoil(g, c, o);
    EXPECT_THAT(message_of([&] { (void)render(g, c, o, 1); }), HasSubstr(words));
  };
  using G = Gaussians;
  using C = Camera;
  using O = RenderOptions;
  refuse([&](G& g, C&, O&) { g.means[3].y() = kNan; }, "Gaussian 3: its mean is not finite");
  refuse([&](G& g, C&, O&) { g.log_scales[1].z() = -INFINITY; }, "Gaussian 1: its log scale");
  refuse([&](G& g, C&, O&) { g.rotations[2][3] = kNan; }, "Gaussian 2: its rotation");
  refuse([&](G& g, C&, O&) { g.rotations[2].setZero(); }, "Gaussian 2: its rotation is a zero");
  refuse([&](G& g, C&, O&) { g.opacities[4] = 1.5F; }, "Gaussian 4: its opacity is 1.5");
  refuse([&](G& g, C&, O&) { g.sh[12 * 2 + 5] = kNan; }, "Gaussian 2: its spherical harmonics");
  refuse([&](G& g, C&, O&) { g.deformation_gradients[0](1, 2) = kNan; }, "Gaussian 0: its deform");
  refuse([&](G& g, C&, O&) { g.opacities.pop_back(); }, "4 numbers or rows of 'opacities'");
  refuse([&](G& g, C&, O&) { g.sh_degree = 4; }, "is 4, expected 0 to 3");
  refuse([&](G&, C& c, O&) { c.width = 0; }, "0 × 30 pixels");
  refuse([&](G&, C& c, O&) { c.fy = -1.0; }, "focal length");
  refuse([&](G&, C& c, O&) { c.rotation *= 2.0; }, "not orthonormal");
  refuse([&](G&, C& c, O&) { c.rotation.col(0) *= -1.0; }, "not orthonormal");
  refuse([&](G&, C& c, O&) { c.translation.x() = NAN; }, "translation is not finite");
  refuse([&](G&, C&, O& o) { o.near_plane = 0.0; }, "near plane");
  refuse([&](G&, C&, O& o) { o.blur = -0.1; }, "blur");

  Rasteriser rasteriser(std::make_shared<Arena>(1));
  GaussianGradients gradients;
  Image loss = loss_for_test(camera.width, camera.height);
  EXPECT_THAT(message_of([&] { rasteriser.backward(good, loss, gradients); }),
              HasSubstr("render() got last"));
  rasteriser.render(good, camera);
  EXPECT_THAT(message_of([&] { rasteriser.backward(good, Image(3, 4), gradients); }),
              HasSubstr("3 × 4 pixels"));
  loss.depth[5] = kNan;
  EXPECT_THAT(message_of([&] { rasteriser.backward(good, loss, gradients); }),
              HasSubstr("loss in the image is not finite"));
}

}  // namespace
}  // namespace matterfit::splat
