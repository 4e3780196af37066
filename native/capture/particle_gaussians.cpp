// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/particle_gaussians.hpp"

#include <cmath>

#include "base/error.hpp"
#include "capture/spherical_harmonics.hpp"

namespace matterfit::capture {
splat::Gaussians particle_gaussians(std::span<const Vec3f> positions,
                                    std::span<const Mat3f> deformation_gradients, double size) {
  if (!deformation_gradients.empty() && deformation_gradients.size() != positions.size()) {
    throw_input("there are " + std::to_string(deformation_gradients.size()) +
                " deformation gradients for " + std::to_string(positions.size()) + " particles.");
  }
  const std::size_t count = positions.size();
  splat::Gaussians gaussians;
  gaussians.means.assign(positions.begin(), positions.end());
  gaussians.log_scales.assign(count, Vec3f::Constant(static_cast<float>(std::log(size))));
  gaussians.rotations.assign(count, Eigen::Vector4f(1, 0, 0, 0));
  gaussians.opacities.assign(count, 1.0F);
  gaussians.sh.assign(3 * count, -0.5F / kShBand0);
  gaussians.deformation_gradients.assign(deformation_gradients.begin(),
                                         deformation_gradients.end());
  for (Mat3f& f : gaussians.deformation_gradients) {
    if (!f.allFinite()) f.setIdentity();
  }
  return gaussians;
}

void set_colour(std::span<float> sh, const Vec3f& colour) {
  for (std::size_t c = 0; c < 3; ++c) sh[c] = (colour[static_cast<int>(c)] - 0.5F) / kShBand0;
}

void set_colours(splat::Gaussians& gaussians, std::span<const Vec3f> colours) {
  if (gaussians.sh_degree != 0 || colours.size() != gaussians.size()) {
    throw_input("colours are set of Gaussians of degree 0, one each.");
  }
  for (std::size_t i = 0; i < colours.size(); ++i) {
    set_colour({gaussians.sh.data() + 3 * i, 3}, colours[i]);
  }
}

}  // namespace matterfit::capture
