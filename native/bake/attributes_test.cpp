// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/attributes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "bake/test_support.hpp"

namespace matterfit::bake {
namespace {

namespace fs = std::filesystem;

class AttributeTest : public FolderTest {
 protected:
  std::vector<float> values(const Specimen& body, Attribute attribute,
                            std::span<const float> strain = {}) {
    return attribute_values(body.view(), strain, attribute, arena_);
  }
  Arena arena_{2};
};

TEST_F(AttributeTest, ValuesOfAKnownDeformation) {
  Specimen body = cube(0.1, 0.2);
  const Mat3d r = Eigen::AngleAxisd(0.3, Vec3d::UnitZ()).toRotationMatrix();
  body.move(r * Vec3d(2.0, 0.5, 1.5).asDiagonal(), Vec3d::Zero(), Mat3d::Identity());
  std::vector<float> strain(body.rest.size(), 0.25F);
  const std::size_t i = 5;
  const auto at = [&](const std::vector<float>& v, int k) {
    return v[3 * i + static_cast<std::size_t>(k)];
  };
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(at(values(body, Attribute::kVolumeRatio), k), 1.5F, 1e-5F);
    EXPECT_NEAR(at(values(body, Attribute::kStretch), k), 2.0F, 1e-5F);
    EXPECT_EQ(at(values(body, Attribute::kPlasticStrain, strain), k), 0.25F);
    EXPECT_EQ(at(values(body, Attribute::kPlasticStrain), k), 0.0F);
    EXPECT_EQ(at(values(body, Attribute::kVelocity), k), body.velocities[i][k]);
  }
  // Ellipsoid: scales 2, 1.5, 0.5 times h along the columns of the Euler rotation.
  const auto scale = values(body, Attribute::kScale);
  const auto euler = values(body, Attribute::kRotation);
  EXPECT_NEAR(at(scale, 0), 0.2F, 1e-6F);
  EXPECT_NEAR(at(scale, 1), 0.15F, 1e-6F);
  EXPECT_NEAR(at(scale, 2), 0.05F, 1e-6F);
  const Mat3d axes = (Eigen::AngleAxisd(static_cast<double>(at(euler, 2)), Vec3d::UnitZ()) *
                      Eigen::AngleAxisd(static_cast<double>(at(euler, 1)), Vec3d::UnitY()) *
                      Eigen::AngleAxisd(static_cast<double>(at(euler, 0)), Vec3d::UnitX()))
                         .toRotationMatrix();
  const Mat3d shape = axes * Vec3d(2.0, 1.5, 0.5).cwiseAbs2().asDiagonal() * axes.transpose();
  const Mat3d f = body.deformation[i].cast<double>();
  EXPECT_LT((shape - f * f.transpose()).norm(), 1e-5);
}

TEST_F(AttributeTest, NamesAreThoseOfTheJob) {
  for (const char* name :
       {"velocity", "plastic_strain", "volume_ratio", "stretch", "rotation", "scale"}) {
    EXPECT_EQ(name_of(attribute_from_name(name)), name);
  }
  EXPECT_NE(message_of(ErrorKind::kInput, [] { (void)attribute_from_name("colour"); })
                .find("plastic_strain"),
            std::string::npos);
}

TEST_F(AttributeTest, LayoutHoldsAllPoints) {
  for (const std::size_t n : {0U, 1U, 2U, 5U, 1000U, 4097U, 1'000'000U, 40'000'000U}) {
    const TextureLayout layout = texture_layout(n);
    EXPECT_GE(static_cast<std::size_t>(layout.width) * static_cast<std::size_t>(layout.height), n);
    EXPECT_LE(layout.width, 4096);
    EXPECT_LE(layout.height, std::max(layout.width, 10000));
  }
}

TEST_F(AttributeTest, SameValuesGiveTheSameBytes) {
  const Specimen body = cube(0.05, 0.4);
  const TextureLayout layout = texture_layout(body.rest.size());
  Arena one(1);
  const auto a = attribute_values(body.view(), {}, Attribute::kStretch, arena_);
  const auto b = attribute_values(body.view(), {}, Attribute::kStretch, one);
  write_attribute_texture(folder_ / "a.exr", layout, a);
  write_attribute_texture(folder_ / "b.exr", layout, b);
  const std::string bytes = slurp(folder_ / "a.exr");
  EXPECT_EQ(bytes, slurp(folder_ / "b.exr"));
  for (const char* word : {"capDate", "Date", "host", "owner"}) {
    EXPECT_EQ(bytes.find(word), std::string::npos) << word;
  }
}

TEST_F(AttributeTest, FullDiskAndBadValuesAreErrors) {
  Specimen body = cube(0.02, 0.3);
  const TextureLayout layout = texture_layout(body.rest.size());
  std::vector<float> noise(3 * body.rest.size());
  for (std::size_t i = 0; i < noise.size(); ++i) {
    noise[i] = std::sin(static_cast<float>(i * i % 7919));
  }
  {
    const FullDisk full(2000);
    EXPECT_NE(message_of(ErrorKind::kOutput,
                         [&] { write_attribute_texture(folder_ / "a.exr", layout, noise); })
                  .find("a.exr"),
              std::string::npos);
  }
  EXPECT_TRUE(fs::is_empty(folder_));
  message_of(ErrorKind::kInput,
             [&] { write_attribute_texture(folder_ / "a.exr", texture_layout(3), noise); });
  std::vector<float> strain(body.rest.size(), 0.0F);
  strain[7] = std::nanf("");
  EXPECT_NE(message_of(ErrorKind::kCompute,
                       [&] { (void)values(body, Attribute::kPlasticStrain, strain); })
                .find("particle 7"),
            std::string::npos);
}

// Blender's own reader, an independent one: pixel of point i where texture_layout() says.
TEST_F(AttributeTest, BlenderReadsTheTexture) {
  int status = 0;
  run("blender --version", status);
  if (status != 0) GTEST_SKIP() << "blender is not installed";
  const std::size_t n = 1000;  // 32 × 32, the last row in part
  std::vector<float> values(3 * n);
  for (std::size_t i = 0; i < n; ++i) {
    values[3 * i] = static_cast<float>(i);
    values[3 * i + 1] = -0.5F * static_cast<float>(i);
    values[3 * i + 2] = 2.5F;
  }
  TextureOptions options;
  write_attribute_texture(folder_ / "half.exr", texture_layout(n), values, options);
  options.half_float = false;
  write_attribute_texture(folder_ / "float.exr", texture_layout(n), values, options);
  spill(folder_ / "check.py", R"(
import bpy, numpy as np, os
here = os.path.dirname(os.path.abspath(__file__))
for name in ('half.exr', 'float.exr'):
    image = bpy.data.images.load(os.path.join(here, name))
    image.colorspace_settings.name = 'Non-Color'
    assert tuple(image.size) == (32, 32), tuple(image.size)
    pixels = np.array(image.pixels[:]).reshape(32, 32, 4)
    i = np.arange(1000)
    got = pixels[31 - i // 32, i % 32]
    assert np.allclose(got[:, 0], i, atol=.3 if name[0] == 'h' else 0), got[:5]
    assert np.allclose(got[:, 1], -.5 * i, atol=.2 if name[0] == 'h' else 0)
    assert (got[:, 2] == 2.5).all() and (got[:, 3] == 1).all()
    assert (pixels[0, 8:, :3] == 0).all()
print('PIXELS READ')
)");
  const std::string home = "HOME='" + folder_.string() + "' XDG_CONFIG_HOME='" + folder_.string() +
                           "' XDG_CACHE_HOME='" + folder_.string() + "' ";
  const std::string text = run(home + "blender -b --factory-startup --python-exit-code 1 -P '" +
                                   (folder_ / "check.py").string() + "'",
                               status);
  EXPECT_EQ(status, 0) << text;
  EXPECT_NE(text.find("PIXELS READ"), std::string::npos) << text;
}

}  // namespace
}  // namespace matterfit::bake
