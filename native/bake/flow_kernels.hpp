// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "capture/particles.hpp"

namespace matterfit::bake {

/// Centres and stretches of the kernels of a body that flows, from where its particles' neighbours
/// are: Yu & Turk 2013, "Reconstructing surfaces of particle-based fluids using
/// anisotropic kernels". Deformation gradients of flows keep elastic parts alone and tell neither.
///
/// Centres are x − λ (I − A)² x, with A the weighted mean over neighbours: the roughness of single
/// particles goes, and a flat surface is drawn in by a quarter of a separation, less than by Yu &
/// Turk's x − λ (I − A) x, which moves every particle near it inward. Stretches are the principal
/// variances of the neighbours' places, divided by their geometric mean: kernels lie flat in a
/// surface and along a strand, so that sheets close.
struct FlowKernels {
  std::vector<Vec3d> centres;  ///< (N) world [m]
  std::vector<Mat3d> shapes;   ///< (N) symmetric; the identity in the bulk and where few are near
};

/// In the order of the particles; the bits do not depend on the number of threads.
[[nodiscard]] FlowKernels flow_kernels(const capture::ParticleView& body, Arena& arena,
                                       const Interrupter& interrupter);

}  // namespace matterfit::bake
