// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_adjoint.hpp"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <utility>

#include "mpm/halo.hpp"
#include "mpm/initial_velocity.hpp"
#include "mpm/node_contact_adjoint.hpp"
#include "mpm/renewed_renewal_adjoint.hpp"
#include "mpm/renewed_touch_adjoint.hpp"
#include "mpm/total_stencil.hpp"
#include "mpm/updated_contact.hpp"

namespace matterfit::mpm {
namespace {

/// Cotangents that a block's particles give back, to the nodes and to sums.
struct RenewedBlockBar {
  RenewedFields fields;
  TermCotangents terms;
  std::vector<shape::ColliderCotangents> colliders;
  double log_density = 0.0;
};

}  // namespace

template <class S>
struct RenewedAdjoint<S>::Impl {
  struct Member {
    std::size_t index;  ///< into scene.bodies
    material::Material material;
    material::LawConstants<S> law;
    RenewedSkin skin;
    std::vector<ContactLaw> contacts;
    std::unique_ptr<BodyTerms> terms;
  };
  const Scene* scene;
  const RenewedAdjointKernels<S>* kernels;
  bool rates;
  double dx;
  std::vector<shape::ColliderPtr> colliders;
  std::vector<shape::ColliderPtr> node_colliders;
  std::vector<std::size_t> places;       ///< of `colliders` in scene.colliders
  std::vector<std::size_t> node_places;  ///< of `node_colliders`
  std::vector<Member> members;
  std::vector<RenewedCargo> cargo;  ///< by member
  // Kept between substeps for their memory alone.
  std::vector<double> force_bar;  ///< node blocks × [3][64]
  std::vector<S> displacement_halo;
  std::vector<S> velocity_halo;
  std::vector<LawCotangents> laws;

  Impl(const Scene& s, const std::vector<std::size_t>& bodies,
       const RenewedAdjointKernels<S>& adjoint_kernels, bool rates_of_all)
      : scene(&s),
        kernels(&adjoint_kernels),
        rates(rates_of_all),
        dx(s.dx),
        colliders(colliders_met(s, false)),
        node_colliders(colliders_met(s, true)),
        places(places_of_met(s, false)),
        node_places(places_of_met(s, true)) {
    for (const std::size_t index : bodies) {
      const Body& body = s.bodies[index];
      const material::LawTraits& traits = body.material.traits();
      Member member{index,
                    body.material,
                    material::law_constants<S>(body.material),
                    {body.density, traits.fluid, traits.wets},
                    {},
                    std::make_unique<BodyTerms>(s, body)};
      for (const shape::ColliderPtr& collider : colliders) {
        member.contacts.push_back(resolve_contact(collider->contact(), body, s.dx));
      }
      cargo.push_back({body.density, traits.fluid, member.law.maxwell_count});
      members.push_back(std::move(member));
    }
  }

  [[nodiscard]] RenewedFields fields(const RenewedState<S>& state, std::size_t m,
                                     std::size_t b) const {
    return {state.reference->grid,
            state.reference->bodies[m].coordinates[b],
            m,
            b,
            dx,
            state.displacement,
            state.velocity};
  }

  /// Particles of every block of a member, side by side: use(block, b). What comes back is added in
  /// the blocks' order.
  template <class Use>
  void for_blocks(Arena& arena, const RenewedState<S>& state, std::size_t m,
                  RenewedCotangents<S>& bar, const Use& use) const {
    const std::size_t count = state.reference->bodies[m].blocks();
    std::vector<RenewedBlockBar> blocks;
    blocks.reserve(count);
    for (std::size_t b = 0; b < count; ++b) {
      blocks.push_back({fields(state, m, b), members[m].terms->zero(), {}, 0.0});
    }
    arena.parallel_for(0, count, 1, [&](std::size_t b) { use(blocks[b], b); });
    for (const RenewedBlockBar& block : blocks) add(block, m, bar);
  }
  void add(const RenewedBlockBar& block, std::size_t m, RenewedCotangents<S>& bar) const {
    block.fields.add_to(bar.displacement, bar.velocity);
    RenewedBodyCotangents<S>& own = bar.bodies[m];
    own.terms += block.terms;
    own.log_density += block.log_density + block.terms.log_density;
    bar.gravity += block.terms.gravity;
    for (std::size_t c = 0; c < block.colliders.size(); ++c) {
      bar.colliders[places[c]] += block.colliders[c];
    }
  }

  /// u' = u + dt v', v' = v + kick (f/m + g), and contact by nodes between: sets force_bar.
  void nodes(Arena& arena, const RenewedSubstep& substep, const RenewedState<S>& before,
             const std::vector<double>& pushed, RenewedCotangents<S>& bar) {
    const RenewedGrid& grid = before.reference->grid;
    const std::vector<double>& mass = before.reference->mass;
    force_bar.assign(before.velocity.size(), 0.0);
    std::vector<Vec3d> gravity(grid.size(), Vec3d::Zero());
    std::vector<shape::ColliderCotangents> met(grid.size() * node_colliders.size());
    arena.parallel_for(0, grid.size(), 4, [&](std::size_t b) {
      double* u_bar = bar.displacement.data() + b * kNodeBlock;
      double* v_bar = bar.velocity.data() + b * kNodeBlock;
      for (std::size_t i = 0; i < kNodeBlock; ++i) v_bar[i] += substep.dt * u_bar[i];
      if (!node_colliders.empty()) {
        node_contact_adjoint(node_colliders, block_origin(grid.coordinates(b), dx), dx,
                             substep.time, mass.data() + b * kBlockNodes,
                             pushed.data() + b * kNodeBlock, v_bar,
                             met.data() + b * node_colliders.size(),
                             before.displacement.data() + b * kNodeBlock, u_bar);
      }
      for (std::size_t n = b * kBlockNodes; n < (b + 1) * kBlockNodes; ++n) {
        if (!(mass[n] > 0.0)) continue;
        const Vec3d a_bar = substep.kick * field_value(bar.velocity, n);
        gravity[b] += a_bar;
        const Vec3d of_force = a_bar / mass[n];
        set_field_value(force_bar, n, of_force);
        const Vec3d a = (field_value(pushed, n) - field_value(before.velocity, n)) / substep.kick -
                        substep.gravity;
        bar.mass[n] -= of_force.dot(a);
      }
    });
    for (const Vec3d& g : gravity) bar.gravity += g;
    for (std::size_t i = 0; i < met.size(); ++i) {
      bar.colliders[node_places[i % node_colliders.size()]] += met[i];
    }
  }

  void terms(Arena& arena, const RenewedSubstep& substep, const RenewedState<S>& before,
             const RenewedState<S>& after, std::size_t m, RenewedCotangents<S>& bar) const {
    const BodyTerms& terms = *members[m].terms;
    if (terms.empty()) return;
    const effects::Moment moment{substep.time, substep.gravity};
    const RenewedStore<S>& store = before.reference->bodies[m];
    const std::vector<S>& history = after.history(m);
    const bool fluid = members[m].skin.fluid;
    for_blocks(arena, before, m, bar, [&](RenewedBlockBar& block, std::size_t b) {
      BlockField forces;
      forces.gather(block.fields.nodes(), force_bar.data());
      store.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
        const BlockField::Stencil s = block_stencil(place, dx);
        const RenewedMotion motion = block.fields.at(place, s);
        effects::MaterialPoint point = terms.point(store.id[slot], store.volume(slot));
        point.position = motion.position;
        point.velocity = motion.velocity;
        Vec3d place_bar = dx * (forces.gradient(s).transpose() * terms.force(point, moment));
        effects::MaterialPointBar own;
        RenewedMotion motion_bar;
        Mat3d stress_bar = Mat3d::Zero();
        const Mat3d since = Mat3d::Identity() + motion.gradient;
        const Mat3d elastic = renewed_elastic(history, fluid, slot);
        if (terms.stress()) {
          // −V τ G⁻ᵀ ∇w, G from the reference to now.
          point.deformation_gradient = since * elastic;
          const Mat3d inverse = since.inverse();
          const Mat3d tau = terms.stress(point, moment);
          const Mat3d nominal_bar = -point.volume * forces.gradient(s);
          place_bar += dx * forces.slope(s, -point.volume * tau * inverse.transpose());
          stress_bar = nominal_bar * inverse;
          motion_bar.gradient =
              -inverse.transpose() * nominal_bar.transpose() * tau * inverse.transpose();
        }
        terms.adjoint(point, moment, forces.at(s), stress_bar, own, block.terms);
        motion_bar.position = own.position;
        motion_bar.velocity = own.velocity;
        if (terms.stress()) {
          motion_bar.gradient += own.deformation_gradient * elastic.transpose();
          renewed_elastic_adjoint(history, fluid, slot,
                                  Mat3d(since.transpose() * own.deformation_gradient),
                                  bar.bodies[m].history);
        }
        place_bar += block.fields.back(s, motion, motion_bar);
        add_place_bar(slot, place_bar, bar.bodies[m].place);
      });
    });
  }

  void internal_forces(Arena& arena, const RenewedSubstep& substep, const RenewedState<S>& before,
                       std::size_t m, RenewedCotangents<S>& bar) {
    const RenewedGrid& grid = before.reference->grid;
    const RenewedStore<S>& store = before.reference->bodies[m];
    RenewedBodyCotangents<S>& own = bar.bodies[m];
    const std::vector<S>& maxwell = before.bodies[m].maxwell;
    displacement_halo.resize(store.blocks() * 3 * kHaloNodes);
    velocity_halo.resize(displacement_halo.size());
    laws.resize(store.blocks());
    RenewedAdjointView<S> view{};
    view.forward.displacement = before.displacement.data();
    view.forward.velocity = before.velocity.data();
    view.forward.block_nodes = grid.nodes_of(m).data();
    view.forward.slab_chunks = store.first_chunk.data();
    view.forward.geometry = store.geometry.data();
    // The adjoint only reads them.
    view.forward.history = const_cast<S*>(before.history(m).data());
    view.forward.maxwell = maxwell.empty() ? nullptr : const_cast<S*>(maxwell.data());
    view.forward.law = members[m].law;
    view.forward.law.damped = view.forward.law.damped || rates;
    view.forward.density = static_cast<S>(members[m].skin.density);
    view.forward.dx = static_cast<S>(dx);
    view.forward.dt = static_cast<S>(substep.dt);
    view.force_bar = force_bar.data();
    view.displacement_bar = displacement_halo.data();
    view.velocity_bar = velocity_halo.data();
    view.place_bar = own.place.data();
    view.history_bar = own.history.data();
    view.maxwell_bar = own.maxwell.data();
    view.law_bar = laws.data();
    arena.parallel_for(0, store.blocks(), 1, [&](std::size_t b) { kernels->forces(view, b); });
    arena.parallel_for(0, grid.size(), 4, [&](std::size_t n) {
      sum_halos(grid, m, n, displacement_halo, bar.displacement.data() + n * kNodeBlock);
      if (view.forward.law.damped) {
        sum_halos(grid, m, n, velocity_halo, bar.velocity.data() + n * kNodeBlock);
      }
    });
    LawCotangents all;
    for (const LawCotangents& block : laws) all += block;
    own.law += all;
    all.add_branches(members[m].material, substep.dt, own.branches);
  }
  static void sum_halos(const RenewedGrid& grid, std::size_t m, std::size_t n,
                        const std::vector<S>& halos, double* out) {
    const std::array<std::uint32_t, 8>& sources = grid.sources(m, n);
    for (std::size_t k = 0; k < 8; ++k) {
      if (sources[k] == kNoBlock) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        add_halo(k, halos.data() + (sources[k] * std::size_t{3} + c) * kHaloNodes,
                 out + c * kBlockNodes);
      }
    }
  }

  /// The touches of one block lie together.
  void touches(Arena& arena, const RenewedSubstep& substep, const RenewedState<S>& before,
               RenewedCotangents<S>& bar) const {
    const std::vector<RenewedTouch>& all = substep.touches;
    std::vector<std::size_t> first;
    for (std::size_t t = 0; t < all.size(); ++t) {
      if (t == 0 || all[t].member != all[t - 1].member || all[t].block != all[t - 1].block) {
        first.push_back(t);
      }
    }
    std::vector<RenewedBlockBar> blocks;
    blocks.reserve(first.size());
    for (const std::size_t t : first) {
      blocks.push_back({fields(before, all[t].member, all[t].block),
                        members[all[t].member].terms->zero(),
                        std::vector<shape::ColliderCotangents>(colliders.size()), 0.0});
    }
    arena.parallel_for(0, first.size(), 1, [&](std::size_t g) {
      const std::size_t end = g + 1 < first.size() ? first[g + 1] : all.size();
      BlockField forces;
      forces.gather(blocks[g].fields.nodes(), force_bar.data());
      for (std::size_t t = end; t-- > first[g];)
        touch(all[t], substep, before, forces, blocks[g], bar);
    });
    for (std::size_t g = 0; g < blocks.size(); ++g) add(blocks[g], all[first[g]].member, bar);
  }
  void touch(const RenewedTouch& touch, const RenewedSubstep& substep,
             const RenewedState<S>& before, const BlockField& forces, RenewedBlockBar& block,
             RenewedCotangents<S>& bar) const {
    const Member& member = members[touch.member];
    const RenewedStore<S>& store = before.reference->bodies[touch.member];
    const std::vector<S>& history = before.history(touch.member);
    RenewedBodyCotangents<S>& own = bar.bodies[touch.member];
    const UpdatedPlace<S> place = store.place(touch.block, slab_of(store, touch), touch.slot);
    const BlockField::Stencil s = block_stencil(place, dx);
    const RenewedMotion motion = block.fields.at(place, s);
    Vec3d& stretch = own.stretch[store.id[touch.slot]];
    const RenewedTouchBar back = renewed_touch_adjoint(
        member.skin, *colliders[touch.collider], member.contacts[touch.collider], touch, substep,
        place, store.volume(touch.slot), renewed_elastic(history, member.skin.fluid, touch.slot),
        motion, forces, dx, stretch);
    stretch = back.stretch;
    block.colliders[touch.collider] += back.collider;
    block.log_density += back.log_density;
    renewed_elastic_adjoint(history, member.skin.fluid, touch.slot, back.elastic, own.history);
    add_place_bar(touch.slot, back.place + block.fields.back(s, motion, back.motion), own.place);
  }
  static std::size_t slab_of(const RenewedStore<S>& store, const RenewedTouch& touch) {
    std::size_t slab = 0;
    while (store.first_chunk[touch.block * kSlabs + slab + 1] <= touch.slot / kLanes) ++slab;
    return slab;
  }
};

template <class S>
RenewedAdjoint<S>::RenewedAdjoint(const Scene& scene, const std::vector<std::size_t>& bodies,
                                  const RenewedAdjointKernels<S>& kernels, bool rates)
    : impl_(std::make_unique<Impl>(scene, bodies, kernels, rates)) {}
template <class S>
RenewedAdjoint<S>::~RenewedAdjoint() = default;

template <class S>
RenewedCotangents<S> RenewedAdjoint<S>::zero(const RenewedState<S>& state) const {
  RenewedCotangents<S> bar;
  for (const typename Impl::Member& member : impl_->members) {
    RenewedBodyCotangents<S> body;
    body.terms = member.terms->zero();
    body.stretch.assign(impl_->scene->bodies[member.index].rest.size(), Vec3d::Zero());
    body.branches.assign(member.material.maxwell.size(), {0.0, 0.0});
    bar.bodies.push_back(std::move(body));
  }
  bar.colliders.resize(impl_->scene->colliders.size());
  clear_state_bars(state, bar, impl_->cargo);
  return bar;
}

template <class S>
bool RenewedAdjoint<S>::looks_into(const RenewedSubstep& substep) const {
  return substep.renewed || !impl_->node_colliders.empty();
}

template <class S>
void RenewedAdjoint<S>::substep(Arena& arena, const RenewedSubstep& substep,
                                const RenewedState<S>& before, const std::vector<double>& pushed,
                                const RenewedState<S>& after, RenewedCotangents<S>& bar) {
  Impl& s = *impl_;
  s.nodes(arena, substep, before, pushed, bar);
  // Terms see the history after the flow, contact that before it.
  for (std::size_t m = 0; m < s.members.size(); ++m) s.terms(arena, substep, before, after, m, bar);
  for (std::size_t m = 0; m < s.members.size(); ++m) {
    s.internal_forces(arena, substep, before, m, bar);
  }
  s.touches(arena, substep, before, bar);
}

template <class S>
void RenewedAdjoint<S>::renewal(Arena& arena, const RenewedState<S>& left,
                                const RenewedState<S>& entered, RenewedCotangents<S>& bar) const {
  renewal_adjoint(arena, left, entered, impl_->cargo, impl_->dx, bar);
}

template <class S>
void RenewedAdjoint<S>::observe(Arena& arena, const RenewedState<S>& state, const FrameLoss& loss,
                                RenewedCotangents<S>& bar) const {
  const Impl& s = *impl_;
  for (std::size_t m = 0; m < s.members.size(); ++m) {
    const FrameLoss::Body& of = loss.bodies[s.members[m].index];
    if (of.positions.empty() && of.velocities.empty() && of.deformation_gradients.empty()) continue;
    const RenewedStore<S>& store = state.reference->bodies[m];
    const std::vector<S>& history = state.history(m);
    const bool fluid = s.members[m].skin.fluid;
    s.for_blocks(arena, state, m, bar, [&](RenewedBlockBar& block, std::size_t b) {
      store.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
        const std::uint32_t p = store.id[slot];
        const BlockField::Stencil at = block_stencil(place, s.dx);
        const RenewedMotion motion = block.fields.at(place, at);
        RenewedMotion motion_bar;
        if (!of.positions.empty()) motion_bar.position = of.positions[p];
        if (!of.velocities.empty()) motion_bar.velocity = of.velocities[p];
        if (!of.deformation_gradients.empty()) {
          const Mat3d& f_bar = of.deformation_gradients[p];
          const Mat3d moved = Mat3d::Identity() + motion.gradient;
          const Mat3d elastic = renewed_elastic(history, fluid, slot);
          Mat3d elastic_bar;
          if (fluid) {  // F = det(I+H)^⅓ Fᵉ
            const double stretch = std::cbrt(moved.determinant());
            elastic_bar = stretch * f_bar;
            motion_bar.gradient = (f_bar.array() * elastic.array()).sum() * stretch / 3.0 *
                                  moved.inverse().transpose();
          } else {
            elastic_bar = moved.transpose() * f_bar;
            motion_bar.gradient = f_bar * elastic.transpose();
          }
          renewed_elastic_adjoint(history, fluid, slot, elastic_bar, bar.bodies[m].history);
        }
        add_place_bar(slot, block.fields.back(at, motion, motion_bar), bar.bodies[m].place);
      });
    });
  }
}

template <class S>
StartCotangents RenewedAdjoint<S>::start(Arena& arena, std::size_t body,
                                         const RenewedState<S>& first,
                                         const RenewedCotangents<S>& bar) const {
  const Impl& s = *impl_;
  const Body& of = s.scene->bodies[s.members[body].index];
  const RenewedBodyCotangents<S>& own = bar.bodies[body];
  const RenewedStore<S>& store = first.reference->bodies[body];
  const RenewedMomentumBar nodes = renewed_momentum_adjoint(arena, first, bar);
  const Vec3d center = center_of_volume(of);
  const Mat3d spin = spin_matrix(of.spin);
  std::vector<TransferCotangents> particles(of.rest.size());
  arena.parallel_for(0, store.blocks(), 1, [&](std::size_t b) {
    store.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
      const std::uint32_t p = store.id[slot];
      particles[p] =
          renewed_enter_adjoint(first.reference->grid, body, place, s.dx, nodes,
                                of.density * of.volumes[p], start_velocity(of, p, center), spin);
      const S* cells = own.place.data() + slot / kLanes * (3 * kLanes) + slot % kLanes;
      for (std::size_t a = 0; a < 3; ++a) {
        particles[p].x[static_cast<int>(a)] += static_cast<double>(cells[a * kLanes]) / s.dx;
      }
    });
  });
  StartCotangents out;
  out.log_density = own.log_density;
  add_first_transfers(of, particles, out);
  return out;
}

template <class S>
material::MaterialGradient RenewedAdjoint<S>::material_gradient(
    std::size_t body, const RenewedCotangents<S>& bar) const {
  material::MaterialGradient out =
      material::material_gradient(impl_->members[body].material, bar.bodies[body].law.constants);
  out.maxwell = bar.bodies[body].branches;
  return out;
}

template <class S>
void RenewedAdjoint<S>::add_terms(std::size_t body, const RenewedCotangents<S>& bar,
                                  double density_bar, std::vector<std::vector<double>>& effects,
                                  material::MaterialGradient& material) const {
  impl_->members[body].terms->add_to(bar.bodies[body].terms, density_bar, effects, material);
}

template class RenewedAdjoint<float>;
template class RenewedAdjoint<double>;

}  // namespace matterfit::mpm
