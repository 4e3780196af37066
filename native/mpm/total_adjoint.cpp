// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_adjoint.hpp"

#include <utility>

#include "mpm/law_kernels.hpp"
#include "mpm/total_block_field.hpp"
#include "mpm/total_node_term.hpp"
#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {
template <class S>
TotalAdjoint<S>::TotalAdjoint(TotalBody<S>& body, const material::Material& material,
                              const AdjointKernels<S>& kernels, bool rates)
    : body_(body), material_(material), kernels_(kernels), rates_(rates) {
  displacement_halo_.assign(body.grid_.blocks() * 3 * kHaloNodes, S(0));
  velocity_halo_.assign(displacement_halo_.size(), S(0));
  block_law_.resize(body.grid_.blocks());
}

template <class S>
TotalCotangents<S> TotalAdjoint<S>::zero() const {
  TotalCotangents<S> bar;
  bar.state.displacement.assign(body_.displacement_.size(), 0.0);
  bar.state.velocity.assign(body_.velocity_.size(), 0.0);
  bar.state.plastic.assign(body_.plastic_.size(), S(0));
  bar.state.maxwell.assign(body_.maxwell_.size() / 2, S(0));
  bar.maxwell.assign(material_.maxwell.size(), {0.0, 0.0});
  return bar;
}

// v' = v + share M⁻¹ (B − L) v at the nodes that are smoothed, L the lumped masses; B is symmetric.
template <class S>
void TotalAdjoint<S>::smooth(Arena& arena, double share, std::vector<double>& velocity_bar) {
  const std::vector<double>& inverse = body_.grid_.inverse_mass();
  const std::vector<double>& lumped = body_.grid_.lumped_mass();
  const std::vector<std::uint8_t>& skip = body_.node_terms_->deferred();
  node_field_.resize(velocity_bar.size());
  arena.parallel_for(0, body_.grid_.node_blocks(), 4, [&](std::size_t b) {
    for (std::size_t i = b * kNodeBlock; i < (b + 1) * kNodeBlock; ++i) {
      const std::size_t n = node_of(i);
      const bool moves = inverse[n] > 0.0 && skip[n] == 0;
      const double taken = moves ? share * inverse[n] * velocity_bar[i] : 0.0;
      node_field_[i] = taken;
      velocity_bar[i] -= lumped[n] * taken;
    }
  });
  TotalView<S> view = body_.view(0.0, false);
  view.velocity = node_field_.data();
  view.force = velocity_halo_.data();
  arena.parallel_for(0, body_.grid_.blocks(), 1,
                     [&](std::size_t b) { body_.kernels_->total_smooth(view, b); });
  arena.parallel_for(0, body_.grid_.node_blocks(), 4, [&](std::size_t b) {
    double sum[kNodeBlock];
    sum_halos(body_.grid_, velocity_halo_.data(), b, sum);
    for (std::size_t i = 0; i < kNodeBlock; ++i) velocity_bar[b * kNodeBlock + i] += sum[i];
  });
}

template <class S>
std::vector<Vec3d> TotalAdjoint<S>::deferred_accelerations(Arena& arena,
                                                           const TotalSubstep& substep) {
  body_.compute_forces(arena, substep.dt, true);
  const Vec3d gravity = body_.grid_.axes().transpose() * substep.gravity;
  std::vector<Vec3d> accelerations;
  double force[kNodeBlock];
  std::size_t summed = ~std::size_t{0};
  for (const std::uint32_t node : body_.node_terms_->deferred_nodes()) {
    if (node / kBlockNodes != summed) {
      summed = node / kBlockNodes;
      body_.sum_internal_forces(summed, force);
    }
    Vec3d f;
    for (std::size_t c = 0; c < 3; ++c) {
      f[static_cast<int>(c)] = force[c * kBlockNodes + node % kBlockNodes];
    }
    accelerations.push_back(body_.grid_.inverse_mass()[node] * f + gravity);
  }
  return accelerations;
}

template <class S>
void TotalAdjoint<S>::substep(Arena& arena, const TotalSubstep& substep,
                              const TotalState<S>& before, TotalCotangents<S>& bar,
                              const std::vector<TotalLoadsAdjoint<S>*>& loads) {
  const TotalGrid& grid = body_.grid_;
  std::vector<double>& u_bar = bar.state.displacement;
  std::vector<double>& v_bar = bar.state.velocity;
  if (substep.smoothing > 0.0) smooth(arena, substep.smoothing, v_bar);
  if (!loads.empty() || body_.node_terms_->pushes()) body_.restore(before);
  body_.clear_loads();
  const bool pushes = body_.node_terms_->pushes() && !substep.held;
  for (TotalLoadsAdjoint<S>* load : loads) load->prepare(arena, substep, pushes);

  // u' = u + dt v', v' = v + kick a, a = f/m + g.
  const std::vector<double>& inverse = grid.inverse_mass();
  const std::vector<std::uint8_t>& skip = body_.node_terms_->deferred();
  std::vector<double>& force_bar = node_field_;
  force_bar.resize(v_bar.size());
  Vec3d gravity_bar = Vec3d::Zero();  // body axes
  std::vector<Vec3d> a_bar;           // of the nodes that terms move
  if (body_.node_terms_->any()) {
    std::vector<Vec3d> accelerations(body_.node_terms_->deferred_nodes().size(), Vec3d::Zero());
    if (pushes) accelerations = deferred_accelerations(arena, substep);
    NodeMotionBar motion = body_.node_terms_->step_adjoint(
        {substep.kick, substep.dt, substep.time, grid.axes().transpose() * substep.gravity},
        accelerations, u_bar, v_bar);
    a_bar = std::move(motion.acceleration);
    gravity_bar = motion.gravity;
    bar.log_density += motion.log_density;
  }
  std::vector<Vec3d> block_gravity(grid.node_blocks());
  arena.parallel_for(0, grid.node_blocks(), 4, [&](std::size_t b) {
    for (std::size_t c = 0; c < 3; ++c) {
      double sum = 0.0;
      for (std::size_t k = 0; k < kBlockNodes; ++k) {
        const std::size_t n = b * kBlockNodes + k;
        if (skip[n] != 0) continue;
        const std::size_t i = b * kNodeBlock + c * kBlockNodes + k;
        v_bar[i] += substep.dt * u_bar[i];
        const double a_bar = substep.kick * v_bar[i];
        sum += a_bar;
        force_bar[i] = inverse[n] * a_bar;
      }
      block_gravity[b][static_cast<int>(c)] = sum;
    }
  });
  for (const Vec3d& block : block_gravity) gravity_bar += block;
  // M⁻¹ + M⁻¹ (M − B) M⁻¹ is symmetric.
  if (substep.kick > 0.0) body_.correct_lumping(arena, force_bar);
  const std::vector<std::uint32_t>& nodes = body_.node_terms_->deferred_nodes();
  for (std::size_t i = 0; i < a_bar.size(); ++i) {
    gravity_bar += a_bar[i];
    set_field_value(force_bar, nodes[i], inverse[nodes[i]] * a_bar[i]);
  }
  gravity_bar = grid.axes() * gravity_bar;
  bar.gravity += gravity_bar;
  bar.gravity_turn += substep.gravity.cross(gravity_bar);
  for (TotalLoadsAdjoint<S>* load : loads) load->back(arena, substep, force_bar, bar);

  if (substep.held) return;
  TotalAdjointView<S> view{};
  view.forward = body_.view(substep.dt, true);
  view.forward.law.damped = view.forward.law.damped || rates_;
  view.forward.displacement = before.displacement.data();
  view.forward.velocity = before.velocity.data();
  // The adjoint only reads the history.
  view.forward.plastic = before.plastic.empty() ? nullptr : const_cast<S*>(before.plastic.data());
  view.forward.maxwell = before.maxwell.empty() ? nullptr : const_cast<S*>(before.maxwell.data());
  view.force_bar = force_bar.data();
  view.displacement_bar = displacement_halo_.data();
  view.velocity_bar = velocity_halo_.data();
  view.plastic_bar = bar.state.plastic.data();
  view.maxwell_bar = bar.state.maxwell.data();
  view.law_bar = block_law_.data();
  const auto forces = total_forces_of(kernels_, body_.law_.law);
  arena.parallel_for(0, grid.blocks(), 1, [&](std::size_t b) { forces(view, b); });
  const bool damped = view.forward.law.damped;
  const double modulus = static_cast<double>(body_.law_.mu);
  std::vector<double> block_work(body_.ties_ ? grid.node_blocks() : 0, 0.0);
  arena.parallel_for(0, grid.node_blocks(), 4, [&](std::size_t b) {
    double sum[kNodeBlock];
    sum_halos(grid, displacement_halo_.data(), b, sum);
    for (std::size_t i = 0; i < kNodeBlock; ++i) u_bar[b * kNodeBlock + i] += sum[i];
    if (body_.ties_) {
      // Linear and symmetric.
      body_.ties_->add_forces(b, modulus, force_bar.data(), u_bar.data() + b * kNodeBlock);
      double pull[kNodeBlock] = {};
      body_.ties_->add_forces(b, modulus, before.displacement.data(), pull);
      for (std::size_t i = 0; i < kNodeBlock; ++i) {
        block_work[b] += force_bar[b * kNodeBlock + i] * pull[i];
      }
    }
    if (!damped) return;
    sum_halos(grid, velocity_halo_.data(), b, sum);
    for (std::size_t i = 0; i < kNodeBlock; ++i) v_bar[b * kNodeBlock + i] += sum[i];
  });
  LawCotangents all;
  for (const LawCotangents& block : block_law_) all += block;
  double work = 0.0;
  for (const double of_block : block_work) work += of_block;
  all.work += work;
  all.constants.mu += work / modulus;
  bar.law += all;
  bar.log_density -= all.work;
  all.add_branches(material_, substep.dt, bar.maxwell);
}

template <class S>
void TotalAdjoint<S>::add_field(Arena& arena, const std::vector<Vec3d>& value_bar,
                                const std::vector<Mat3d>& gradient_bar,
                                std::vector<double>& node_bar) const {
  if (value_bar.empty() && gradient_bar.empty()) return;
  const TotalGrid& grid = body_.grid_;
  const Mat3d& axes = grid.axes();
  std::vector<BlockField> fields(grid.blocks());
  arena.parallel_for(0, grid.blocks(), 1, [&](std::size_t b) {
    fields[b].clear();
    for (const std::uint32_t p : grid.block_particles(b)) {
      Vec3d value = Vec3d::Zero();
      Mat3d rows = Mat3d::Zero();
      if (!value_bar.empty()) value = axes.transpose() * value_bar[p];
      if (!gradient_bar.empty()) rows = axes.transpose() * gradient_bar[p] * axes;
      fields[b].add({grid.point_of(p), grid.dx()}, value, rows);
    }
  });
  arena.parallel_for(0, grid.node_blocks(), 4, [&](std::size_t b) {
    const std::array<std::uint32_t, 8>& sources = grid.node_sources(b);
    for (std::size_t k = 0; k < 8; ++k) {
      if (sources[k] != kNoBlock) fields[sources[k]].add_to(k, node_bar.data() + b * kNodeBlock);
    }
  });
}

template <class S>
void TotalAdjoint<S>::add_particles(Arena& arena, const std::vector<Vec3d>& position_bar,
                                    const std::vector<Vec3d>& velocity_bar,
                                    const std::vector<Mat3d>& deformation_gradient_bar,
                                    TotalCotangents<S>& bar) const {
  add_field(arena, position_bar, deformation_gradient_bar, bar.state.displacement);
  add_field(arena, velocity_bar, {}, bar.state.velocity);
}

template <class S>
InitialCotangents TotalAdjoint<S>::initial(const TotalCotangents<S>& bar) const {
  const TotalGrid& grid = body_.grid_;
  const auto at = [&](std::uint32_t n) { return field_value(bar.state.velocity, n); };
  InitialCotangents out;
  for (std::uint32_t n = 0; n < grid.mass().size(); ++n) {
    const Vec3d v = at(n);
    out.velocity += v;
    out.spin += (grid.node_position(n) - grid.center_of_mass()).cross(v);
  }
  out.velocity = grid.axes() * out.velocity;
  out.spin = grid.axes() * out.spin;
  out.particle_velocities.assign(grid.particles(), Vec3d::Zero());
  NodesOfCell nodes_of(grid);
  for (const QuadraturePoint& q : grid.quadrature()) {
    const std::array<std::uint32_t, 27>& nodes = nodes_of(q.cell);
    const PointStencil s(q.f, grid.dx());
    Vec3d sum = Vec3d::Zero();
    for (std::size_t i = 0; i < 27; ++i) {
      sum += s.weight(i / 9, i / 3 % 3, i % 3) / grid.lumped_mass()[nodes[i]] * at(nodes[i]);
    }
    out.particle_velocities[q.particle] += body_.density_ * q.volume * (grid.axes() * sum);
  }
  return out;
}

template <class S>
material::MaterialGradient TotalAdjoint<S>::material_gradient(const TotalCotangents<S>& bar) const {
  material::MaterialGradient out = material::material_gradient(material_, bar.law.constants);
  out.maxwell = bar.maxwell;
  return out;
}

template class TotalAdjoint<float>;
template class TotalAdjoint<double>;

}  // namespace matterfit::mpm
