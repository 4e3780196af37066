// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_terms.hpp"

#include <algorithm>

#include "mpm/updated_back.hpp"

namespace matterfit::mpm {

template <class S>
UpdatedTerms<S>::UpdatedTerms(const Scene& scene, const std::vector<std::size_t>& bodies)
    : dx_(scene.dx) {
  terms_.reserve(bodies.size());
  for (const std::size_t index : bodies) {
    terms_.push_back(std::make_unique<BodyTerms>(scene, scene.bodies[index]));
    any_ = any_ || !terms_.back()->empty();
    act_ = act_ || terms_.back()->act();
  }
}

template <class S>
void UpdatedTerms<S>::push(Arena& arena, UpdatedGrid<S>& grid, const effects::Moment& moment,
                           double kick) const {
  using Chunk = UpdatedChunk<S>;
  if (!act_) return;
  arena.parallel_for(0, grid.blocks.size(), 1, [&](std::size_t b) {
    if (!grid.blocks[b].occupied) return;
    for (std::size_t m = 0; m < terms_.size(); ++m) {
      const BodyTerms& terms = *terms_[m];
      if (!terms.act()) continue;
      grid.blocks[b].bodies[m].for_each([&](std::size_t s, const Chunk& chunk, std::size_t l) {
        const UpdatedPlace<S> place = grid.place(b, s, chunk, l);
        effects::MaterialPoint at =
            terms.point(chunk.id[l], static_cast<double>(chunk.a[Chunk::kVolume][l]));
        at.position = grid.position(place);
        at.velocity = particle_velocity(chunk, l);
        const Vec3d impulse = kick * terms.force(at, moment);
        grid.add_momentum(place, impulse.template cast<S>(), S(0));
        if (!terms.stress()) return;
        // −V τ ∇w.
        at.deformation_gradient = deformation_gradient(chunk, l);
        grid.add_gradient_momentum(place, -kick * at.volume * terms.stress(at, moment));
      });
    }
  });
}

template <class S>
void UpdatedTerms<S>::push_adjoint(Arena& arena, const UpdatedRecord<S>& record,
                                   const std::vector<S>& nodes, UpdatedCotangents<S>& bar) const {
  using Chunk = UpdatedChunk<S>;
  const std::size_t blocks = record.before->coordinates.size();
  const std::size_t members = terms_.size();
  std::vector<TermCotangents> of_block(blocks * members);
  const effects::Moment moment{record.time, record.gravity};
  arena.parallel_for(0, of_block.size(), 1, [&](std::size_t at) {
    const std::size_t b = at / members;
    const std::size_t m = at % members;
    const BodyTerms& terms = *terms_[m];
    TermCotangents& sums = of_block[at];
    sums = terms.zero();
    if (terms.empty()) return;
    const Vec3d origin = record.before->coordinates[b].template cast<double>() * (4.0 * dx_);
    const std::uint32_t* first = record.slab_chunks.data() + at * kSlabs;
    for (std::size_t s = 0; s < kSlabs; ++s) {
      for (std::uint32_t c = first[s]; c < first[s + 1]; ++c) {
        const KeptChunk<S>& chunk = record.chunks[c];
        for (std::size_t l = 0; l < kLanes; ++l) {
          if (!(chunk.a[Chunk::kVolume][l] > S(0))) continue;
          const UpdatedPlace<S> place{
              static_cast<std::uint32_t>(b),
              static_cast<std::uint32_t>(s * kLanes + l),
              {chunk.a[Chunk::kF][l], chunk.a[Chunk::kF + 1][l], chunk.a[Chunk::kF + 2][l]}};
          effects::MaterialPoint seen =
              terms.point(chunk.id[l], static_cast<double>(chunk.a[Chunk::kVolume][l]));
          seen.position = place.position(origin, dx_);
          const KeptVelocity<S>& kept = record.velocities[c];
          for (int axis = 0; axis < 3; ++axis) {
            seen.velocity[axis] = static_cast<double>(kept.v[axis][l]);
          }
          // Momentum Σ w_I kick f.
          Vec3d momentum_bar = Vec3d::Zero();
          Mat3d momentum_by = Mat3d::Zero();
          const PointStencil stencil(place.fraction(), dx_);
          for_each_cotangent(*record.before, nodes, place,
                             [&](const Vec3d& momentum, double /*mass*/, std::size_t i,
                                 std::size_t j, std::size_t k) {
                               momentum_bar += stencil.weight(i, j, k) * momentum;
                               momentum_by += momentum * stencil.gradient(i, j, k).transpose();
                             });
          effects::MaterialPointBar point_bar;
          point_bar.position = record.kick * (momentum_by.transpose() * terms.force(seen, moment));
          Mat3d stress_bar = Mat3d::Zero();
          if (terms.stress()) {
            for (int i = 0; i < 9; ++i) {
              seen.deformation_gradient(i / 3, i % 3) +=
                  static_cast<double>(chunk.a[Chunk::kH + static_cast<std::size_t>(i)][l]);
            }
            // −kick V τ ∇w, and ∇w moves with the place.
            stress_bar = -record.kick * seen.volume * momentum_by;
            const Mat3d tau = -record.kick * seen.volume * terms.stress(seen, moment);
            for_each_cotangent(*record.before, nodes, place,
                               [&](const Vec3d& momentum, double /*mass*/, std::size_t i,
                                   std::size_t j, std::size_t k) {
                                 point_bar.position +=
                                     stencil.curvature(i, j, k, dx_) * (tau.transpose() * momentum);
                               });
          }
          terms.adjoint(seen, moment, record.kick * momentum_bar, stress_bar, point_bar, sums);
          UpdatedParticleBar<S>& own = bar.bodies[m].particles[chunk.id[l]];
          for (std::size_t axis = 0; axis < 3; ++axis) {
            own.position[axis] += static_cast<S>(point_bar.position[static_cast<int>(axis)]);
            own.velocity[axis] += static_cast<S>(point_bar.velocity[static_cast<int>(axis)]);
          }
          for (std::size_t i = 0; i < 9; ++i) {
            own.h[i] += static_cast<S>(
                point_bar.deformation_gradient(static_cast<int>(i / 3), static_cast<int>(i % 3)));
          }
        }
      }
    }
  });
  for (std::size_t m = 0; m < members; ++m) {
    TermCotangents sums = terms_[m]->zero();
    for (std::size_t b = 0; b < blocks; ++b) sums += of_block[b * members + m];
    bar.bodies[m].terms += sums;
    bar.bodies[m].log_density += sums.log_density;
    bar.gravity += sums.gravity;
  }
}

template <class S>
double UpdatedTerms<S>::acceleration_bound(double speed) const {
  double most = 0.0;
  for (const auto& terms : terms_) most = std::max(most, terms->acceleration_bound(speed));
  return most;
}

template class UpdatedTerms<float>;
template class UpdatedTerms<double>;

}  // namespace matterfit::mpm
