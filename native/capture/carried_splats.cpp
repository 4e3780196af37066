// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/carried_splats.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "capture/spherical_harmonics.hpp"

namespace matterfit::capture {
namespace {

Points means_of(const Splats& splats) {
  Points means;
  means.reserve(splats.size());
  for (const Vec3f& x : splats.means) means.push_back(x.cast<double>());
  return means;
}

BindingOptions options_for(const mpm::Body& body, const Interrupter* interrupter) {
  BindingOptions options;
  options.gradient = binding_gradient(body);
  options.interrupter = interrupter;
  return options;
}

}  // namespace

Splats placed(Splats splats, const Vec3d& position, const Quatd& rotation, double scale) {
  const Eigen::Quaternionf turn = rotation.cast<float>();
  const ShRotation turn_colours(rotation.toRotationMatrix());
  const std::size_t stride = 3 * splats.sh_bands();
  for (std::size_t i = 0; i < splats.size(); ++i) {
    const Vec3d mean = rotation * (scale * splats.means[i].cast<double>()) + position;
    splats.means[i] = mean.cast<float>();
    splats.rotations[i] = turn * splats.rotations[i];
    splats.scales[i] *= static_cast<float>(scale);
    turn_colours.apply({splats.sh.data() + stride * i, stride}, splats.sh_degree);
  }
  return splats;
}

void carry_colours(std::span<float> sh, int degree, const Mat3d& polar) {
  if (degree > 0) ShRotation(polar).apply(sh, degree);
}

CarriedSplats::CarriedSplats(Splats rest, const mpm::Body& body, double separation, Arena& arena,
                             const Interrupter* interrupter)
    : rest_(std::move(rest)),
      binding_(means_of(rest_), body.rest, separation, options_for(body, interrupter), arena) {}

splat::Gaussians CarriedSplats::at(const ParticleView& state, Arena& arena) const {
  splat::Gaussians gaussians = gaussians_of(rest_);
  const std::vector<Vec3d> means = binding_.positions(state, arena);
  const std::vector<Mat3d> gradients = binding_.deformation_gradients(state, arena);
  gaussians.deformation_gradients.resize(size());
  const std::size_t stride = 3 * rest_.sh_bands();
  arena.parallel_for(0, size(), 64, [&](std::size_t i) {
    const Mat3d f = gradients[i].allFinite() ? gradients[i] : Mat3d(Mat3d::Identity());
    gaussians.means[i] = means[i].cast<float>();
    gaussians.deformation_gradients[i] = f.cast<float>();
    if (rest_.sh_degree > 0) {
      carry_colours({gaussians.sh.data() + stride * i, stride}, rest_.sh_degree, polar_rotation(f));
    }
  });
  return gaussians;
}

void CarriedSplats::add_bars(const ParticleView& state, const splat::GaussianGradients& bar,
                             std::size_t first, std::optional<int> sh_degree,
                             std::span<Vec3d> particle_bar,
                             std::span<Mat3d> deformation_gradient_bar, Arena& arena) const {
  std::vector<Vec3d> means(size());
  std::vector<Mat3d> gradients(size());
  for (std::size_t i = 0; i < size(); ++i) {
    means[i] = bar.means[first + i].cast<double>();
    gradients[i] = bar.deformation_gradients[first + i].cast<double>();
  }
  if (rest_.sh_degree > 0 && sh_degree) {
    const splat::Gaussians now = at(state, arena);
    const std::size_t own = 3 * rest_.sh_bands();
    const std::size_t stride = 3 * splat::sh_bands(*sh_degree);
    const std::span<const float> turned(now.sh);
    const std::span<const float> bars(bar.sh);
    arena.parallel_for(0, size(), 64, [&](std::size_t i) {
      const std::span<const float> of = bars.subspan(stride * (first + i), own);
      if (std::all_of(of.begin(), of.end(), [](float x) { return x == 0.0F; })) return;
      const Vec3d spin = ShRotation::spin_bar(turned.subspan(own * i, own), of, rest_.sh_degree);
      gradients[i] += polar_rotation_adjoint(now.deformation_gradients[i].cast<double>(), spin);
    });
  }
  binding_.spread(means, particle_bar, deformation_gradient_bar);
  binding_.spread_gradients(gradients, particle_bar, deformation_gradient_bar);
}

}  // namespace matterfit::capture
