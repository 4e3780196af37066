// SPDX-License-Identifier: GPL-3.0-or-later
// A RenewedGroup's state: as it is seen, recorded and saved.
#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "mpm/renewed_group_impl.hpp"

namespace matterfit::mpm {

template <class S>
void RenewedGroup<S>::sample(Arena& arena, std::vector<BodyState>& bodies) const {
  const Impl& s = *impl_;
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    const RenewedBody<S>& body = s.bodies[m];
    BodyState& out = bodies[body.index()];
    out.positions.resize(body.particles());
    out.velocities.resize(body.particles());
    out.deformation_gradients.resize(body.particles());
    out.plastic_strain.resize(body.law().plastic ? body.particles() : 0);
    s.for_each(arena, m, [&](std::size_t slot, const RenewedParticle& particle) {
      const std::uint32_t p = body.store().id[slot];
      out.positions[p] = particle.position.cast<float>();
      out.velocities[p] = particle.velocity.cast<float>();
      out.deformation_gradients[p] = particle.elastic.cast<float>();
      if (body.law().plastic) {
        out.plastic_strain[p] = static_cast<float>(body.plastic_strain(slot));
      }
    });
  }
}

template <class S>
void RenewedGroup<S>::observe(Arena& arena, bool deformation_gradients,
                              std::vector<ObservedFrame::Body>& bodies) const {
  const Impl& s = *impl_;
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    const RenewedBody<S>& body = s.bodies[m];
    ObservedFrame::Body& out = bodies[body.index()];
    out.positions.resize(body.particles());
    out.velocities.resize(body.particles());
    if (deformation_gradients) out.deformation_gradients.resize(body.particles());
    s.for_each(arena, m, [&](std::size_t slot, const RenewedParticle& particle) {
      const std::uint32_t p = body.store().id[slot];
      out.positions[p] = particle.position;
      out.velocities[p] = particle.velocity;
      if (deformation_gradients) out.deformation_gradients[p] = particle.elastic;
    });
  }
}

template <class S>
void RenewedGroup<S>::report(FrameReport& report) const {
  const Impl& s = *impl_;
  report.max_speed = std::max(report.max_speed, s.fastest());
  report.renewals = s.renewed_at;
  for (const RenewedContact<S>& contact : s.contacts) {
    report.max_penetration = std::max(report.max_penetration, contact.max_penetration());
  }
  for (std::size_t n = 0; n < s.mass.size(); ++n) {
    if (!(s.mass[n] > 0.0)) continue;
    report.kinetic_energy += 0.5 * s.mass[n] * field_value(s.velocity, n).squaredNorm();
  }
}

template <class S>
std::pair<Vec3d, Vec3d> RenewedGroup<S>::momentum() const {
  const Impl& s = *impl_;
  Vec3d linear = Vec3d::Zero();
  Vec3d angular = Vec3d::Zero();
  for (std::size_t n = 0; n < s.mass.size(); ++n) {
    if (!(s.mass[n] > 0.0)) continue;
    const Vec3d origin = block_origin(s.grid.coordinates(n / kBlockNodes), s.dx);
    const Vec3d x =
        position_of_node(origin, s.dx, n % kBlockNodes) + field_value(s.displacement, n);
    const Vec3d momentum = s.mass[n] * field_value(s.velocity, n);
    linear += momentum;
    angular += x.cross(momentum);
  }
  return {linear, angular};
}

template <class S>
void RenewedGroup<S>::collect(const Vec3d& low, const Vec3d& high,
                              std::vector<BodyPoint<S>>& out) const {
  const Impl& s = *impl_;
  out.clear();
  for (const auto& [m, b] : s.work) {
    const RenewedBody<S>& body = s.bodies[m];
    const std::uint32_t* nodes = s.grid.nodes_of(m).data() + std::size_t{8} * b;
    BlockField displacement;
    displacement.gather(nodes, s.displacement.data());
    const Vec3d origin = block_origin(body.coordinates()[b], s.dx);
    BlockField velocity;
    bool has_velocity = false;
    body.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
      const BlockField::Stencil at = block_stencil(place, s.dx);
      const Vec3d x = place.position(origin, s.dx) + displacement.at(at);
      if ((x.array() < low.array()).any() || (x.array() > high.array()).any()) return;
      if (!has_velocity) velocity.gather(nodes, s.velocity.data());
      has_velocity = true;
      const double volume = body.volume(slot);
      out.push_back({place, static_cast<std::uint32_t>(body.index()), body.store().id[slot], x,
                     velocity.at(at), volume, volume * body.density()});
    });
  }
}

template <class S>
RenewedState<S> RenewedGroup<S>::record() {
  Impl& s = *impl_;
  if (!s.reference) {
    auto made = std::make_shared<RenewedReference<S>>();
    made->grid = s.grid;
    made->mass = s.mass;
    for (const RenewedBody<S>& body : s.bodies) {
      made->bodies.push_back(body.store());
      made->bodies.back().maxwell.clear();
      if (body.law().plastic) made->bodies.back().history.clear();
    }
    s.reference = std::move(made);
  }
  RenewedState<S> out;
  out.reference = s.reference;
  out.displacement = s.displacement;
  out.velocity = s.velocity;
  out.last_dt = s.last_dt;
  out.min_j = s.min_j;
  out.acceleration = s.acceleration;
  out.looks = s.looks;
  out.substeps = s.substeps;
  out.substep = s.substep;
  out.planned = s.planned;
  out.renewed_at = s.renewed_at;
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    const RenewedBody<S>& body = s.bodies[m];
    out.bodies.push_back({body.law().plastic ? body.store().history : std::vector<S>{},
                          body.store().maxwell, s.contacts[m].memories()});
  }
  return out;
}

template <class S>
void RenewedGroup<S>::restore(const RenewedState<S>& state) {
  Impl& s = *impl_;
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    s.bodies[m].restore(state.reference->bodies[m], state.history(m), state.bodies[m].maxwell);
    s.contacts[m].restore(state.bodies[m].memory);
  }
  if (s.reference != state.reference) {
    s.link();
    s.mass = state.reference->mass;
    s.reference = state.reference;
  }
  s.displacement = state.displacement;
  s.velocity = state.velocity;
  s.last_dt = state.last_dt;
  s.min_j = state.min_j;
  s.looks = state.looks;
  s.substeps = state.substeps;
  s.substep = state.substep;
  s.planned = state.planned;
  s.renewed_at = state.renewed_at;
  s.begin_contact(state.acceleration);
}

template <class S>
void RenewedGroup<S>::save(ByteWriter& out) const {
  const Impl& s = *impl_;
  out.put(s.last_dt);
  out.put(s.min_j);
  out.put(s.renewals);
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    s.bodies[m].save(out);
    s.contacts[m].save(out);
  }
  out.put(s.displacement);
  out.put(s.velocity);
  out.put(s.mass);
}

template <class S>
void RenewedGroup<S>::load(ByteReader& in) {
  Impl& s = *impl_;
  in.get(s.last_dt);
  in.get(s.min_j);
  in.get(s.renewals);
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    s.bodies[m].load(in);
    s.contacts[m].load(in);
  }
  s.link();
  s.displacement.resize(s.grid.size() * kNodeBlock);
  s.velocity.resize(s.grid.size() * kNodeBlock);
  s.mass.resize(s.grid.size() * kBlockNodes);
  in.get_same_size(s.displacement);
  in.get_same_size(s.velocity);
  in.get_same_size(s.mass);
}

template void RenewedGroup<float>::sample(Arena&, std::vector<BodyState>&) const;
template void RenewedGroup<float>::observe(Arena&, bool, std::vector<ObservedFrame::Body>&) const;
template void RenewedGroup<float>::report(FrameReport&) const;
template std::pair<Vec3d, Vec3d> RenewedGroup<float>::momentum() const;
template void RenewedGroup<float>::collect(const Vec3d&, const Vec3d&,
                                           std::vector<BodyPoint<float>>&) const;
template RenewedState<float> RenewedGroup<float>::record();
template void RenewedGroup<float>::restore(const RenewedState<float>&);
template void RenewedGroup<float>::save(ByteWriter&) const;
template void RenewedGroup<float>::load(ByteReader&);
template void RenewedGroup<double>::sample(Arena&, std::vector<BodyState>&) const;
template void RenewedGroup<double>::observe(Arena&, bool, std::vector<ObservedFrame::Body>&) const;
template void RenewedGroup<double>::report(FrameReport&) const;
template std::pair<Vec3d, Vec3d> RenewedGroup<double>::momentum() const;
template void RenewedGroup<double>::collect(const Vec3d&, const Vec3d&,
                                            std::vector<BodyPoint<double>>&) const;
template RenewedState<double> RenewedGroup<double>::record();
template void RenewedGroup<double>::restore(const RenewedState<double>&);
template void RenewedGroup<double>::save(ByteWriter&) const;
template void RenewedGroup<double>::load(ByteReader&);

}  // namespace matterfit::mpm
