// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// The centre of the particles' volumes, at rest.
[[nodiscard]] Vec3d center_of_volume(const Body& body);
/// Matrix of v = spin × x.
[[nodiscard]] Mat3d spin_matrix(const Vec3d& spin);
/// Initial velocity of a particle [m/s].
[[nodiscard]] Vec3d start_velocity(const Body& body, std::size_t particle, const Vec3d& center);

}  // namespace matterfit::mpm
