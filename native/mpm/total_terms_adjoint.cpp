// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_terms_adjoint.hpp"

#include <Eigen/LU>

namespace matterfit::mpm {

template <class S>
TotalTermsAdjoint<S>::TotalTermsAdjoint(const Scene& scene, const Body& body, TotalBody<S>& total)
    : body_(total), terms_(scene, body, total), sums_(terms_.terms().zero()) {
  if (!terms_.terms().empty()) blocks_.resize(total.blocks());
}

template <class S>
void TotalTermsAdjoint<S>::prepare(Arena& arena, const TotalSubstep& substep, bool forces) {
  if (forces) terms_.apply(arena, body_, substep);
}

template <class S>
void TotalTermsAdjoint<S>::back(std::size_t block, const effects::Moment& moment,
                                const std::vector<double>& force_bar, BlockBar& bar) const {
  const TotalGrid& grid = body_.grid();
  const BodyTerms& terms = terms_.terms();
  const Mat3d& axes = grid.axes();
  BlockField displacement;
  BlockField velocity;
  BlockField forces;
  displacement.gather(grid, block, body_.displacement().data());
  velocity.gather(grid, block, body_.velocity().data());
  forces.gather(grid, block, force_bar.data());
  bar.displacement.clear();
  bar.velocity.clear();
  bar.sums = terms.zero();
  bar.log_density = 0.0;
  for (const auto& point : terms_.points(block)) {
    const BlockField::Stencil stencil(point.place.cell, grid.dx());
    const effects::MaterialPoint at = terms_.seen(body_, point, stencil, displacement, velocity);
    const Vec3d force_at = axes * forces.at(stencil);
    effects::MaterialPointBar own;
    bar.log_density -= force_at.dot(terms.force(at, moment));
    Mat3d stress_bar = Mat3d::Zero();
    if (terms.stress()) {
      // −V P ∇₀w, P = τ A, A = F⁻ᵀ.
      const Mat3d nominal_bar =
          -point.volume * (axes * forces.gradient(stencil) * axes.transpose());
      const Mat3d inverse = at.deformation_gradient.inverse();
      const Mat3d tau = terms.stress(at, moment);
      stress_bar = nominal_bar * inverse;
      bar.log_density -= (stress_bar.array() * tau.array()).sum();
      own.deformation_gradient =
          -inverse.transpose() * nominal_bar.transpose() * tau * inverse.transpose();
    }
    terms.adjoint(at, moment, force_at, stress_bar, own, bar.sums);
    bar.displacement.add(stencil, axes.transpose() * own.position,
                         axes.transpose() * own.deformation_gradient * axes);
    bar.velocity.add(stencil, axes.transpose() * own.velocity);
  }
}

template <class S>
void TotalTermsAdjoint<S>::back(Arena& arena, const TotalSubstep& substep,
                                const std::vector<double>& force_bar, TotalCotangents<S>& bar) {
  if (substep.held) return;  // no force moves a node
  arena.parallel_for(0, blocks_.size(), 1, [&](std::size_t b) {
    back(b, {substep.time, substep.gravity}, force_bar, blocks_[b]);
  });
  const TotalGrid& grid = body_.grid();
  double* u_bar = bar.state.displacement.data();
  double* v_bar = bar.state.velocity.data();
  // Sums must not depend on threads: each is made in order, by one.
  arena.parallel_for(0, grid.node_blocks(), 4, [&](std::size_t n) {
    const std::array<std::uint32_t, 8>& sources = grid.node_sources(n);
    for (std::size_t k = 0; k < 8; ++k) {
      if (sources[k] == kNoBlock) continue;
      blocks_[sources[k]].displacement.add_to(k, u_bar + n * kNodeBlock);
      blocks_[sources[k]].velocity.add_to(k, v_bar + n * kNodeBlock);
    }
  });
  for (const BlockBar& block : blocks_) {
    sums_ += block.sums;
    bar.gravity += block.sums.gravity;
    bar.log_density += block.sums.log_density + block.log_density;
  }
}

template class TotalTermsAdjoint<float>;
template class TotalTermsAdjoint<double>;

}  // namespace matterfit::mpm
