// SPDX-License-Identifier: GPL-3.0-or-later
#include "splat/check.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "base/error.hpp"

namespace matterfit::splat {
namespace {

constexpr int kMostPixels = 1 << 15;  // along an edge
constexpr double kOrthonormal = 1e-6;
constexpr std::size_t kGrain = 4096;

/// 1 where it is not finite, else 0.
std::uint32_t wrong(float value) {
  constexpr std::uint32_t kExponent = 0x7f800000U;
  return (std::bit_cast<std::uint32_t>(value) & kExponent) == kExponent ? 1U : 0U;
}

/// No branch until something is wrong, and rows that fill registers: this runs over all numbers
/// before each image.
bool all_finite(const float* values, std::size_t count) {
  constexpr std::size_t kRow = 16;
  std::uint32_t found[kRow] = {};
  std::size_t i = 0;
  for (; i + kRow <= count; i += kRow) {
    for (std::size_t k = 0; k < kRow; ++k) found[k] |= wrong(values[i + k]);
  }
  for (; i < count; ++i) found[0] |= wrong(values[i]);
  return std::ranges::all_of(found, [](std::uint32_t one) { return one == 0; });
}

bool all_finite(const float* values, std::size_t count, Arena& arena) {
  const std::size_t blocks = (count + kGrain - 1) / kGrain;
  std::vector<std::uint8_t> fine(blocks);
  arena.parallel_for(0, blocks, 4, [&](std::size_t block) {
    const std::size_t begin = block * kGrain;
    fine[block] = all_finite(values + begin, std::min(kGrain, count - begin)) ? 1 : 0;
  });
  return std::ranges::find(fine, 0) == fine.end();
}

void check_finite(const char* what, const float* values, std::size_t count, std::size_t per_row,
                  Arena& arena) {
  if (all_finite(values, count, arena)) return;
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isfinite(values[i])) {
      throw_input("Gaussian " + std::to_string(i / per_row) + ": its " + what +
                  " is not finite. Remove it, or mend what computed it.");
    }
  }
}

void check_count(const char* what, std::size_t has, std::size_t expected) {
  if (has != expected) {
    throw_input("the Gaussians have " + std::to_string(has) + " numbers or rows of '" + what +
                "', expected " + std::to_string(expected) + ".");
  }
}

}  // namespace

void check_camera(const Camera& camera, const RenderOptions& options) {
  for (const int size : {camera.width, camera.height}) {
    if (size < 1 || size > kMostPixels) {
      throw_input("the camera's image is " + std::to_string(camera.width) + " × " +
                  std::to_string(camera.height) + " pixels, expected 1 to " +
                  std::to_string(kMostPixels) + " along each edge.");
    }
  }
  for (const double focal : {camera.fx, camera.fy}) {
    if (!(focal > 0.0) || !std::isfinite(focal)) {
      throw_input("a focal length of the camera is " + std::to_string(focal) +
                  " pixels, expected a positive number.");
    }
  }
  if (!std::isfinite(camera.cx) || !std::isfinite(camera.cy)) {
    throw_input("the camera's principal point is not finite.");
  }
  if (!camera.translation.allFinite()) throw_input("the camera's translation is not finite.");
  const Mat3d square = camera.rotation * camera.rotation.transpose();
  if (!((square - Mat3d::Identity()).norm() < kOrthonormal) ||
      !(camera.rotation.determinant() > 0.0)) {
    throw_input(
        "the camera's rotation is not orthonormal with determinant 1. Divide out its scale, and "
        "check the axes: x right, y down, z forward.");
  }
  if (!(options.near_plane > 0.0) || !std::isfinite(options.near_plane)) {
    throw_input("the near plane is at " + std::to_string(options.near_plane) +
                " m, expected more than 0.");
  }
  if (!(options.blur >= 0.0) || !std::isfinite(options.blur)) {
    throw_input("the blur is " + std::to_string(options.blur) + " pixels², expected 0 or more.");
  }
}

void check_gaussians(const Gaussians& g, Arena& arena) {
  if (g.sh_degree < 0 || g.sh_degree > kMaxShDegree) {
    throw_input("the degree of the spherical harmonics is " + std::to_string(g.sh_degree) +
                ", expected 0 to 3.");
  }
  const std::size_t count = g.size();
  if (count >= std::numeric_limits<std::uint32_t>::max()) throw_input("too many Gaussians.");
  check_count("log_scales", g.log_scales.size(), count);
  check_count("rotations", g.rotations.size(), count);
  check_count("opacities", g.opacities.size(), count);
  check_count("sh", g.sh.size(), 3 * count * sh_bands(g.sh_degree));
  if (!g.deformation_gradients.empty()) {
    check_count("deformation_gradients", g.deformation_gradients.size(), count);
  }
  if (count == 0) return;
  check_finite("mean", g.means[0].data(), 3 * count, 3, arena);
  check_finite("log scale", g.log_scales[0].data(), 3 * count, 3, arena);
  check_finite("rotation", g.rotations[0].data(), 4 * count, 4, arena);
  check_finite("opacity", g.opacities.data(), count, 1, arena);
  check_finite("spherical harmonics", g.sh.data(), g.sh.size(), g.sh.size() / count, arena);
  if (!g.deformation_gradients.empty()) {
    check_finite("deformation gradient", g.deformation_gradients[0].data(), 9 * count, 9, arena);
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!(g.opacities[i] >= 0.0F && g.opacities[i] <= 1.0F)) {
      throw_input("Gaussian " + std::to_string(i) + ": its opacity is " +
                  std::to_string(g.opacities[i]) +
                  ", expected 0 to 1. Apply the sigmoid to a file's logits.");
    }
    const Eigen::Vector4f& q = g.rotations[i];
    if (q[0] == 0.0F && q[1] == 0.0F && q[2] == 0.0F && q[3] == 0.0F) {
      throw_input("Gaussian " + std::to_string(i) + ": its rotation is a zero quaternion.");
    }
  }
}

void check_loss_gradient(const Image& loss, int width, int height, Arena& arena) {
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (loss.width != width || loss.height != height || loss.colour.size() != 3 * pixels ||
      loss.mask.size() != pixels || loss.depth.size() != pixels) {
    throw_input("the gradient of the loss is of an image of " + std::to_string(loss.width) + " × " +
                std::to_string(loss.height) + " pixels, expected " + std::to_string(width) + " × " +
                std::to_string(height) + " with colour, mask and depth.");
  }
  const std::span<const float> channels[] = {loss.colour, loss.mask, loss.depth};
  for (const auto& channel : channels) {
    if (!all_finite(channel.data(), channel.size(), arena)) {
      throw_input("the gradient of the loss in the image is not finite.");
    }
  }
}

}  // namespace matterfit::splat
