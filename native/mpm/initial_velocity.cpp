// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/initial_velocity.hpp"

namespace matterfit::mpm {

Vec3d center_of_volume(const Body& body) {
  Vec3d center = Vec3d::Zero();
  double volume = 0.0;
  for (std::size_t p = 0; p < body.rest.size(); ++p) {
    center += body.volumes[p] * body.rest[p];
    volume += body.volumes[p];
  }
  return center / volume;
}

Mat3d spin_matrix(const Vec3d& spin) {
  Mat3d m;
  m << 0, -spin[2], spin[1], spin[2], 0, -spin[0], -spin[1], spin[0], 0;
  return m;
}

Vec3d start_velocity(const Body& body, std::size_t particle, const Vec3d& center) {
  Vec3d v = body.velocity + spin_matrix(body.spin) * (body.rest[particle] - center);
  if (!body.particle_velocities.empty()) v += body.particle_velocities[particle];
  return v;
}

}  // namespace matterfit::mpm
