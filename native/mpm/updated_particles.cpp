// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_particles.hpp"

#include <algorithm>

namespace matterfit::mpm {

template <class S>
void collect_points(const UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                    const Vec3d& low, const Vec3d& high, std::vector<BodyPoint<S>>& out) {
  out.clear();
  for (std::size_t b = 0; b < grid.blocks.size(); ++b) {
    const UpdatedBlock<S>& block = grid.blocks[b];
    if (!block.occupied) continue;
    const Vec3d from = grid.origin(b);
    if ((from.array() > high.array()).any() ||
        ((from + Vec3d::Constant(5.0 * grid.dx)).array() < low.array()).any()) {
      continue;
    }
    for (std::size_t m = 0; m < members.size(); ++m) {
      block.bodies[m].for_each([&](std::size_t slab, const UpdatedChunk<S>& chunk,
                                   std::size_t lane) {
        BodyPoint<S> p;
        p.place = grid.place(b, slab, chunk, lane);
        p.position = grid.position(p.place);
        if ((p.position.array() < low.array()).any() || (p.position.array() > high.array()).any()) {
          return;
        }
        p.body = static_cast<std::uint32_t>(members[m].index);
        p.id = chunk.id[lane];
        p.velocity = particle_velocity(chunk, lane);
        p.volume = static_cast<double>(chunk.a[UpdatedChunk<S>::kVolume][lane]);
        p.mass = p.volume * members[m].density;
        out.push_back(p);
      });
    }
  }
}

template <class S>
std::vector<UpdatedParticle> particles_of(const UpdatedGrid<S>& grid,
                                          const std::vector<UpdatedMember<S>>& members,
                                          std::size_t body) {
  using Chunk = UpdatedChunk<S>;
  std::vector<UpdatedParticle> out(members[body].particles);
  for (std::size_t b = 0; b < grid.blocks.size(); ++b) {
    grid.blocks[b].bodies[body].for_each([&](std::size_t slab, const Chunk& chunk, std::size_t l) {
      out[chunk.id[l]] = {grid.position(grid.place(b, slab, chunk, l)), particle_velocity(chunk, l),
                          deformation_gradient(chunk, l),
                          static_cast<double>(chunk.a[Chunk::kStrain][l])};
    });
  }
  return out;
}

template <class S>
void sample_particles(const UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                      std::vector<BodyState>& bodies) {
  using Chunk = UpdatedChunk<S>;
  for (std::size_t m = 0; m < members.size(); ++m) {
    BodyState& out = bodies[members[m].index];
    const std::size_t n = members[m].particles;
    out.positions.resize(n);
    out.velocities.resize(n);
    out.deformation_gradients.resize(n);
    out.plastic_strain.resize(members[m].law.plastic ? n : 0);
    for (std::size_t b = 0; b < grid.blocks.size(); ++b) {
      grid.blocks[b].bodies[m].for_each([&](std::size_t slab, const Chunk& chunk, std::size_t l) {
        const std::uint32_t p = chunk.id[l];
        out.positions[p] = grid.position(grid.place(b, slab, chunk, l)).template cast<float>();
        for (std::size_t c = 0; c < 3; ++c) {
          out.velocities[p][static_cast<int>(c)] =
              static_cast<float>(chunk.a[Chunk::kVelocity + c][l]);
        }
        for (std::size_t c = 0; c < 9; ++c) {
          out.deformation_gradients[p](static_cast<int>(c / 3), static_cast<int>(c % 3)) =
              static_cast<float>(chunk.a[Chunk::kH + c][l] + (c % 4 == 0 ? S(1) : S(0)));
        }
        if (members[m].law.plastic) {
          out.plastic_strain[p] = static_cast<float>(chunk.a[Chunk::kStrain][l]);
        }
      });
    }
  }
}

template <class S>
void report_particles(const UpdatedGrid<S>& grid, const std::vector<UpdatedMember<S>>& members,
                      FrameReport& report) {
  for (std::size_t b = 0; b < grid.blocks.size(); ++b) {
    report.max_penetration = std::max(report.max_penetration, grid.blocks[b].penetration);
    for (std::size_t m = 0; m < members.size(); ++m) {
      double sum = 0.0;
      grid.blocks[b].bodies[m].for_each(
          [&](std::size_t, const UpdatedChunk<S>& chunk, std::size_t l) {
            double v2 = 0.0;
            for (std::size_t c = 0; c < 3; ++c) {
              const auto v = static_cast<double>(chunk.a[UpdatedChunk<S>::kVelocity + c][l]);
              v2 += v * v;
            }
            sum += v2 * static_cast<double>(chunk.a[UpdatedChunk<S>::kVolume][l]);
          });
      report.kinetic_energy += 0.5 * members[m].density * sum;
    }
  }
}

template void collect_points<float>(const UpdatedGrid<float>&,
                                    const std::vector<UpdatedMember<float>>&, const Vec3d&,
                                    const Vec3d&, std::vector<BodyPoint<float>>&);
template void collect_points<double>(const UpdatedGrid<double>&,
                                     const std::vector<UpdatedMember<double>>&, const Vec3d&,
                                     const Vec3d&, std::vector<BodyPoint<double>>&);
template std::vector<UpdatedParticle> particles_of<float>(const UpdatedGrid<float>&,
                                                          const std::vector<UpdatedMember<float>>&,
                                                          std::size_t);
template std::vector<UpdatedParticle> particles_of<double>(
    const UpdatedGrid<double>&, const std::vector<UpdatedMember<double>>&, std::size_t);
template void sample_particles<float>(const UpdatedGrid<float>&,
                                      const std::vector<UpdatedMember<float>>&,
                                      std::vector<BodyState>&);
template void sample_particles<double>(const UpdatedGrid<double>&,
                                       const std::vector<UpdatedMember<double>>&,
                                       std::vector<BodyState>&);
template void report_particles<float>(const UpdatedGrid<float>&,
                                      const std::vector<UpdatedMember<float>>&, FrameReport&);
template void report_particles<double>(const UpdatedGrid<double>&,
                                       const std::vector<UpdatedMember<double>>&, FrameReport&);

}  // namespace matterfit::mpm
