// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/start_cotangents.hpp"

#include "mpm/initial_velocity.hpp"

namespace matterfit::mpm {

void TransferCotangents::add_node(const PointStencil& stencil, const Vec3d& f, double dx,
                                  std::size_t i, std::size_t j, std::size_t k, double mass,
                                  const Vec3d& velocity, const Mat3d& of_affine,
                                  const Vec3d& momentum_bar, double mass_bar) {
  const double w = stencil.weight(i, j, k);
  const Vec3d arm = dx * (stencil_node(i, j, k) - f);
  const double all = momentum_bar.dot(velocity + of_affine * arm) + mass_bar;
  v += mass * w * momentum_bar;
  affine += mass * w * momentum_bar * arm.transpose();
  x += mass * (all * stencil.gradient(i, j, k) - w * (of_affine.transpose() * momentum_bar));
  log_density += mass * w * all;
}

void add_first_transfers(const Body& body, const std::vector<TransferCotangents>& particles,
                         StartCotangents& out) {
  const Vec3d center = center_of_volume(body);
  const Mat3d spin = spin_matrix(body.spin);
  Vec3d center_bar = Vec3d::Zero();
  double volume = 0.0;
  out.positions.assign(particles.size(), Vec3d::Zero());
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const TransferCotangents& at = particles[p];
    const Vec3d arm = body.rest[p] - center;
    volume += body.volumes[p];
    out.log_density += at.log_density;
    out.velocity += at.v;
    out.particle_velocities.push_back(at.v);
    out.spin += arm.cross(at.v) + Vec3d(at.affine(2, 1) - at.affine(1, 2),
                                        at.affine(0, 2) - at.affine(2, 0),
                                        at.affine(1, 0) - at.affine(0, 1));
    const Vec3d arm_bar = spin.transpose() * at.v;
    center_bar -= arm_bar;
    out.positions[p] = at.x + arm_bar;
  }
  for (std::size_t p = 0; p < particles.size(); ++p) {
    out.positions[p] += body.volumes[p] / volume * center_bar;
    out.offset += out.positions[p];
    out.rotation += (body.rest[p] - center).cross(out.positions[p]);
  }
}

}  // namespace matterfit::mpm
