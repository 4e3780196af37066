// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "mpm/simulation.hpp"

namespace matterfit::job {

/// `state/state_0012.safetensors`: digits at least four, so that names sort.
[[nodiscard]] std::string frame_digits(int frame);
[[nodiscard]] std::string state_path(int frame);

/// One frame as a safetensors file (docs/formats.md): BODY.positions (N,3) [m], BODY.velocities
/// (N,3) [m/s], BODY.deformation_gradients (N,3,3) row by row, BODY.plastic_strain (N) where the
/// law has one. Particles in the order of the body's source.
[[nodiscard]] std::string format_state(const mpm::Scene& scene, const mpm::FrameState& state);

/// Reads back exactly what format_state wrote for a scene with the same bodies.
[[nodiscard]] mpm::FrameState read_state(const std::filesystem::path& path,
                                         const mpm::Scene& scene);

}  // namespace matterfit::job
