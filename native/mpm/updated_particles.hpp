// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "mpm/particle_bodies.hpp"
#include "mpm/simulation.hpp"
#include "mpm/updated_grid.hpp"
#include "mpm/updated_member.hpp"
#include "mpm/updated_place.hpp"

/// What the particles of updated Lagrangian bodies do, read from the blocks of the grid.
namespace matterfit::mpm {

/// What a particle does, world axes.
struct UpdatedParticle {
  Vec3d position = Vec3d::Zero();                  ///< [m]
  Vec3d velocity = Vec3d::Zero();                  ///< [m/s]
  Mat3d deformation_gradient = Mat3d::Identity();  ///< elastic
  double plastic_strain = 0.0;                     ///< equivalent
};

/// Particles inside a box, in storage order.
template <class S>
void collect_points(const UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                    const Vec3d& low, const Vec3d& high, std::vector<BodyPoint<S>>& out);

/// Particles of the n-th of the members, in the order of Body::rest.
template <class S>
[[nodiscard]] std::vector<UpdatedParticle> particles_of(
    const UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members, std::size_t body);

/// Sets the states of the members' bodies; `bodies` as scene.bodies.
template <class S>
void sample_particles(const UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                      std::vector<BodyState>& bodies);

/// Adds the kinetic energy, and how deep particles are inside colliders.
template <class S>
void report_particles(const UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                      FrameReport& report);

extern template void collect_points<float>(const UpdatedGrid<float>&,
                                           const std::vector<UpdatedMember<float>>&, const Vec3d&,
                                           const Vec3d&, std::vector<BodyPoint<float>>&);
extern template void collect_points<double>(const UpdatedGrid<double>&,
                                            const std::vector<UpdatedMember<double>>&, const Vec3d&,
                                            const Vec3d&, std::vector<BodyPoint<double>>&);
extern template std::vector<UpdatedParticle> particles_of<float>(
    const UpdatedGrid<float>&, const std::vector<UpdatedMember<float>>&, std::size_t);
extern template std::vector<UpdatedParticle> particles_of<double>(
    const UpdatedGrid<double>&, const std::vector<UpdatedMember<double>>&, std::size_t);
extern template void sample_particles<float>(const UpdatedGrid<float>&,
                                             const std::vector<UpdatedMember<float>>&,
                                             std::vector<BodyState>&);
extern template void sample_particles<double>(const UpdatedGrid<double>&,
                                              const std::vector<UpdatedMember<double>>&,
                                              std::vector<BodyState>&);
extern template void report_particles<float>(const UpdatedGrid<float>&,
                                             const std::vector<UpdatedMember<float>>&,
                                             FrameReport&);
extern template void report_particles<double>(const UpdatedGrid<double>&,
                                              const std::vector<UpdatedMember<double>>&,
                                              FrameReport&);

}  // namespace matterfit::mpm
