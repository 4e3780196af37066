// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_group.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "mpm/renewed_check.hpp"
#include "mpm/renewed_group_impl.hpp"
#include "mpm/renewed_limit.hpp"

namespace matterfit::mpm {

template <class S>
RenewedGroup<S>::RenewedGroup(const Scene& scene, const std::vector<std::size_t>& bodies,
                              const RenewedKernels<S>& kernels, std::size_t memory_limit)
    : impl_(std::make_unique<Impl>(scene, bodies, kernels, memory_limit)) {}
template <class S>
RenewedGroup<S>::~RenewedGroup() = default;

template <class S>
std::pair<double, std::string> RenewedGroup<S>::limit_step(double time) const {
  const Impl& s = *impl_;
  const double speed = s.fastest() + s.pull(time) / s.scene->fps;
  return renewed_limit(*s.scene, s.bodies, s.contacts, s.terms, s.min_j, speed);
}

template <class S>
double RenewedGroup<S>::whole_substeps(double time, double count) const {
  const double looks = impl_->looks_of_frame(time);
  return std::ceil(count / looks * (1.0 - 1e-12)) * looks;
}

template <class S>
void RenewedGroup<S>::begin_frame(double time, int substeps,
                                  const std::optional<std::vector<double>>& renewals) {
  Impl& s = *impl_;
  s.looks = s.looks_of_frame(time);
  s.substeps = substeps;
  s.substep = 0;
  s.planned = renewals;
  s.renewed_at.clear();
  const double speed = s.fastest() + s.pull(time) / s.scene->fps;
  for (std::size_t m = 0; m < s.bodies.size(); ++m) s.terms.of(m).check_step(speed);
  s.begin_contact(s.pull(time));
}

template <class S>
std::pair<double, double> RenewedGroup<S>::step(Arena& arena, double time, double dt,
                                                const Vec3d& gravity) {
  Impl& s = *impl_;
  const std::vector<RenewedView<S>> all = s.views(dt, Vec3d::Zero());
  s.for_blocks(arena, [&](std::size_t i, std::uint32_t m, std::uint32_t b) {
    s.contacts[m].apply(s.bodies[m], b, s.grid.nodes_of(m).data() + std::size_t{8} * b,
                        s.displacement, s.velocity, s.dx, time, dt, s.loads[i],
                        s.followed != nullptr ? &s.touches[i] : nullptr);
    s.loads[i].insert(s.loads[i].end(), s.pushes[i].begin(), s.pushes[i].end());
    s.pushes[i].clear();
    s.kernels->forces(all[m], b);
    s.add_loads(i, m, b);
    s.terms.add(s.bodies[m], m, b, s.grid.nodes_of(m).data() + std::size_t{8} * b, s.displacement,
                s.velocity, s.dx, {time, gravity});
  });
  double least = 1.0;
  double most = 1.0;
  for (const RenewedBody<S>& body : s.bodies) {
    for (const BlockExtremes<S>& e : body.extremes()) {
      least = std::min(least, static_cast<double>(e.min_volume_ratio));
      most = std::max(most, static_cast<double>(e.max_volume_ratio));
    }
  }
  if (!(least > 0.0)) fail_renewed(*s.scene, s.bodies, s.grid, s.displacement, time);
  s.min_j = least;
  const double kick = 0.5 * (s.last_dt + dt);
  if (s.followed != nullptr) s.note(time, dt, kick, gravity);
  if (s.pushed != nullptr) s.pushed->resize(s.velocity.size());
  s.move_nodes(arena, kick, time, dt, gravity);
  s.last_dt = dt;
  ++s.substep;
  if (s.pushed == nullptr && s.is_due(arena)) {
    if (s.followed != nullptr) s.followed->renewed = true;
    s.renewed_at.push_back(static_cast<double>(s.substep) / s.substeps);
    s.renew(arena);
  }
  return {least, most};
}

template <class S>
std::uint64_t RenewedGroup<S>::renewals() const {
  return impl_->renewals;
}

template <class S>
void RenewedGroup<S>::renew(Arena& arena) {
  impl_->renew(arena);
}

template <class S>
void RenewedGroup<S>::push(const BodyPoint<S>& point, const Vec3d& force, double /*dt*/) {
  Impl& s = *impl_;
  std::size_t m = 0;
  while (s.bodies[m].index() != point.body) ++m;
  s.pushes[s.first_work[m] + point.place.block].push_back({point.place, force});
}

template <class S>
double RenewedGroup<S>::max_speed() const {
  return impl_->fastest();
}

template <class S>
double RenewedGroup<S>::term_acceleration() const {
  return impl_->term_acceleration();
}

template <class S>
void RenewedGroup<S>::follow(RenewedSubstep* substep) {
  impl_->followed = substep;
  for (std::vector<RenewedTouch>& touches : impl_->touches) touches.clear();
}

template <class S>
void RenewedGroup<S>::look_into(std::vector<double>* pushed) {
  impl_->pushed = pushed;
}

template class RenewedGroup<float>;
template class RenewedGroup<double>;

}  // namespace matterfit::mpm
