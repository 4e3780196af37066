// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_terms.hpp"

#include <Eigen/LU>
#include <algorithm>

namespace matterfit::mpm {

template <class S>
TotalTerms<S>::TotalTerms(const Scene& scene, const Body& body, const TotalBody<S>& total)
    : terms_(scene, body) {
  if (terms_.empty()) return;
  const TotalGrid& grid = total.grid();
  std::vector<std::size_t> slab_of(grid.chunks());
  for (std::size_t slab = 0; slab < grid.blocks() * kSlabs; ++slab) {
    std::fill(slab_of.begin() + grid.slab_chunks()[slab],
              slab_of.begin() + grid.slab_chunks()[slab + 1], slab);
  }
  points_.resize(grid.blocks());
  const std::vector<QuadraturePoint>& all = grid.quadrature();
  for (std::size_t q = 0; q < all.size(); ++q) {
    const std::size_t slab = slab_of[grid.place(q) / kLanes];
    const std::size_t lane = grid.place(q) % kLanes;
    const CellPoint cell{static_cast<std::uint32_t>(slab / kSlabs), slab % kSlabs, lane / 4,
                         lane % 4, all[q].f};
    const Vec3d rest = grid.node_position(grid.find_node(all[q].cell)) + grid.dx() * all[q].f;
    points_[cell.block].push_back({{rest, cell}, all[q].particle, all[q].volume});
  }
  forces_.resize(grid.blocks());
}

template <class S>
effects::MaterialPoint TotalTerms<S>::seen(const TotalBody<S>& body, const Point& point,
                                           const BlockField::Stencil& stencil,
                                           const BlockField& displacement,
                                           const BlockField& velocity) const {
  effects::MaterialPoint seen = terms_.point(point.particle, point.volume);
  const auto state = body.state(point.place, displacement.at(stencil), velocity.at(stencil));
  seen.rest = body.grid().to_world(point.place.rest);
  seen.position = state.position;
  seen.velocity = state.velocity;
  if (terms_.stress()) {
    seen.deformation_gradient = body.deformation_gradient(displacement.gradient(stencil));
  }
  return seen;
}

template <class S>
void TotalTerms<S>::apply(Arena& arena, TotalBody<S>& body, const TotalSubstep& substep) {
  if (!terms_.act() || substep.held) return;
  const effects::Moment moment{substep.time, substep.gravity};
  const Mat3d to_local = body.grid().axes().transpose();
  arena.parallel_for(0, points_.size(), 1, [&](std::size_t b) {
    forces_[b].clear();
    BlockField displacement;
    BlockField velocity;
    displacement.gather(body.grid(), b, body.displacement().data());
    velocity.gather(body.grid(), b, body.velocity().data());
    for (const Point& point : points_[b]) {
      const BlockField::Stencil stencil(point.place.cell, body.grid().dx());
      const effects::MaterialPoint at = seen(body, point, stencil, displacement, velocity);
      const Vec3d force = to_local * terms_.force(at, moment);
      if (!terms_.stress()) {
        forces_[b].add(stencil, force);
        continue;
      }
      // −V P ∇₀w, P = τ F⁻ᵀ.
      const Mat3d nominal =
          terms_.stress(at, moment) * at.deformation_gradient.inverse().transpose();
      forces_[b].add(stencil, force, -point.volume * (to_local * nominal * to_local.transpose()));
    }
  });
  body.set_node_forces(forces_.data());
}

template class TotalTerms<float>;
template class TotalTerms<double>;

}  // namespace matterfit::mpm
