// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_group_adjoint.hpp"

#include "mpm/initial_velocity.hpp"

namespace matterfit::mpm {

template <class S>
TotalGroupAdjoint<S>::TotalGroupAdjoint(const Scene& scene, TotalGroup<S>& group, SimdTarget target,
                                        bool rates) {
  for (std::size_t m = 0; m < group.size(); ++m) {
    const Body& body = scene.bodies[group.index(m)];
    std::unique_ptr<TotalContactAdjoint<S>> contact;
    if (!scene.colliders.empty()) {
      contact = std::make_unique<TotalContactAdjoint<S>>(body, scene, group.body(m));
    }
    auto terms = std::make_unique<TotalTermsAdjoint<S>>(scene, body, group.body(m));
    if (terms->terms().empty()) terms.reset();
    std::vector<TotalLoadsAdjoint<S>*> loads;
    if (contact) loads.push_back(contact.get());
    if (terms) loads.push_back(terms.get());
    TotalAdjoint<S> adjoint(group.body(m), body.material, adjoint_kernels<S>(target), rates);
    TotalCotangents<S> bar = adjoint.zero();
    members_.push_back({group.index(m), std::move(adjoint), std::move(contact), std::move(terms),
                        std::move(loads), std::move(bar), Vec3d::Zero(), &body});
  }
}

template <class S>
void TotalGroupAdjoint<S>::observe(Arena& arena, const FrameLoss& loss) {
  for (Member& member : members_) {
    const FrameLoss::Body& body = loss.bodies[member.index];
    member.adjoint.add_particles(arena, body.positions, body.velocities, body.deformation_gradients,
                                 member.bar);
    for (const Vec3d& bar : body.positions) member.observed += bar;
  }
}

template <class S>
void TotalGroupAdjoint<S>::substep(Arena& arena, const std::vector<TotalSubstep>& taken,
                                   const States& before,
                                   const std::vector<ContactMemories>& after) {
  for (std::size_t m = 0; m < members_.size(); ++m) {
    Member& member = members_[m];
    if (member.contact) member.contact->set_memory(before[m].contact.memory, after[m]);
    member.adjoint.substep(arena, taken[m], before[m].body, member.bar, member.loads);
  }
}

template <class S>
void TotalGroupAdjoint<S>::collect(const std::vector<Vec3d>& observed, Gradient& out) const {
  for (const Member& member : members_) {
    BodyGradient& body = out.bodies[member.index];
    body.material = member.adjoint.material_gradient(member.bar);
    body.density = member.bar.log_density / member.body->density;
    InitialCotangents initial = member.adjoint.initial(member.bar);
    body.velocity = initial.velocity;
    body.spin = initial.spin;
    body.offset = member.observed;
    // To turn the body is to turn everything else the other way, and what is seen with the body.
    const Vec3d center = center_of_volume(*member.body);
    body.rotation = observed[member.index] - center.cross(member.observed) -
                    member.bar.gravity_turn - member.body->velocity.cross(initial.velocity) -
                    member.body->spin.cross(initial.spin);
    for (std::size_t p = 0; p < member.body->particle_velocities.size(); ++p) {
      body.rotation -= member.body->particle_velocities[p].cross(initial.particle_velocities[p]);
    }
    body.particle_velocities = std::move(initial.particle_velocities);
    out.gravity += member.bar.gravity;
    if (member.terms) {
      const TermCotangents& sums = member.terms->sums();
      body.offset += sums.position + sums.rest;
      body.rotation += sums.turn + sums.rest_turn - center.cross(sums.position + sums.rest);
      member.terms->terms().add_to(sums, body.density, out.effects, body.material);
    }
    if (!member.contact) continue;
    for (std::size_t c = 0; c < out.colliders.size(); ++c) {
      const shape::ColliderCotangents& own = member.contact->colliders()[c];
      out.colliders[c] += own;
      body.offset -= own.translation;  // a collider that comes nearer is a body that does
      body.rotation -= own.rotation - center.cross(own.translation);
    }
  }
}

template class TotalGroupAdjoint<float>;
template class TotalGroupAdjoint<double>;

}  // namespace matterfit::mpm
