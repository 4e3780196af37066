// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// The limit of stability of a body's substeps [s] as it follows from its material, what the
/// scene's effects add to it, and the stiffest contact of the scene that has a stiffness: ω² of the
/// stiffest cell, with the damping's share ξ of critical. Right to its order; how it changes with
/// the material is exact.
[[nodiscard]] double step_limit(const Scene& scene, const Body& body);
/// The shortest limit of the scene's bodies.
[[nodiscard]] double step_limit(const Scene& scene);

}  // namespace matterfit::mpm
