// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_group.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "base/cancel_check.hpp"
#include "mpm/scene_check.hpp"
#include "mpm/unstable_error.hpp"

namespace matterfit::mpm {
namespace {

/// Volume ratios and speeds [m/s] beyond it are as little a result as what is not a number.
constexpr double kNoResult = 1e30;
constexpr int kFirstIterations = 60;
constexpr int kFrameIterations = 16;
/// Share of the unresolved part of a body's velocity that a substep at the stability limit takes
/// away, applied every few substeps (docs/why.md: what it costs a beam).
constexpr double kSmoothing = 0.02;
constexpr int kSmoothingInterval = 8;
/// The share by which a frame's energies may seem to grow. A substep's work is that of its force at
/// the velocity before, which is short by the square of the velocity's change in it, and the
/// fastest modes, at velocities half a substep off their shape, show up to dt_safety² of their
/// energy twice (docs/why.md): a cube of two cells that lands seems to gain 17 % in a frame. An
/// instability doubles its own within a few substeps.
constexpr double kEnergySlack = 0.5;

}  // namespace

template <class S>
std::size_t TotalMemberState<S>::bytes() const {
  return sizeof(*this) + bytes_of(body.displacement) + bytes_of(body.velocity) +
         bytes_of(body.plastic) + bytes_of(body.maxwell) + bytes_of(contact.memory) +
         bytes_of(contact.wake_time);
}

/// A force evaluation for each of the probe's iterations: not where little has changed.
template <class S>
bool TotalGroup<S>::Member::needs_probe() const {
  constexpr int kOften = 64;
  constexpr S kChange = S(0.05F);
  return since_probe >= kOften ||
         std::abs(latest.min_volume_ratio - probed.min_volume_ratio) > kChange ||
         std::abs(latest.max_volume_ratio - probed.max_volume_ratio) > kChange;
}

template <class S>
TotalGroup<S>::TotalGroup(const Scene& scene, const Kernels<S>& kernels,
                          const Interrupter* interrupter)
    : scene_(scene) {
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    if (!is_total(scene.bodies[i])) continue;
    Member member;
    member.index = i;
    member.body = std::make_unique<TotalBody<S>>(scene.bodies[i], scene, kernels, interrupter);
    check_cancel(interrupter);
    member.contact = std::make_unique<TotalContact<S>>(scene.bodies[i], scene, *member.body);
    check_cancel(interrupter);
    member.terms = std::make_unique<TotalTerms<S>>(scene, scene.bodies[i], *member.body);
    if (member.contact->any()) member.loads.push_back(member.contact.get());
    if (!member.terms->terms().empty()) member.loads.push_back(member.terms.get());
    member.start = member.body->mass_moment(0.0);
    member.budget = member.body->kinetic_energy();
    member.budget_known = true;
    members_.push_back(std::move(member));
  }
  last_.resize(members_.size());
}

template <class S>
bool TotalGroup<S>::all_held(double time) const {
  return std::all_of(members_.begin(), members_.end(),
                     [&](const Member& m) { return m.body->held(time); });
}

template <class S>
void TotalGroup<S>::limit_step(Arena& arena, double time, const OtherContact& other,
                               StepLimit& limit, const Interrupter& interrupter) {
  for (Member& member : members_) {
    // A body let go within the frame needs its own limit from the start of the frame.
    if (member.body->held(time + 1.0 / scene_.fps - 1e-9)) continue;
    const bool first = member.elastic_dt <= 0.0;
    if (first || (!(scene_.dt > 0.0) && member.needs_probe())) {
      const double found = member.body->stable_time_step(
          arena, first ? kFirstIterations : kFrameIterations, interrupter);
      // A body that flows answers softly to the probe, and stiffly as soon as it unloads.
      const bool flows = !scene_.bodies[member.index].material.traits().elastic();
      member.elastic_dt = flows && !first ? std::min(member.elastic_dt, found) : found;
      member.probed = member.latest;
      member.since_probe = 0;
    }
    const double pull = scene_.gravity.at(time).norm();
    const BodyTerms& terms = member.terms->terms();
    double speed = member.body->max_speed();
    speed += (pull + terms.acceleration_bound(speed)) / scene_.fps;
    terms.check_step(speed);
    if (scene_.dt > 0.0) continue;
    if (member.contact->any() || other.any) {
      // A face must not cross a collider, nor what resists it, within a substep.
      if (speed > 0.0) limit.limit_to(scene_.cfl * scene_.dx / speed, "CFL");
    }
    double omega = 2.0 / member.elastic_dt;
    if (const double more = terms.modulus_bound(); more > 0.0) {
      const material::Material& own = scene_.bodies[member.index].material;
      const double density = scene_.bodies[member.index].density;
      const double wave = own.wave_speed(density);
      omega *= std::sqrt(1.0 + more / (density * wave * wave));
    }
    const double pressure = meeting_pressure(scene_.bodies[member.index], speed, pull);
    const double contact = member.contact->frequency_squared(pressure) + other.frequency_squared;
    const double fastest = std::sqrt(omega * omega + contact);
    // Explicit damping lowers the limit 2/ω to (2/ω)(√(1 + ξ²) − ξ), ξ its share of critical
    // (Belytschko, Liu and Moran, Nonlinear Finite Elements, §6.6.6); the rate of a damping is
    // 27 η/(2 ρ dx²) at most, as that of the same modulus in place of it.
    const material::Material& m = scene_.bodies[member.index].material;
    const double viscous = 2.0 * m.damping_shear + m.damping_bulk;
    const double drag = terms.rate_bound(speed);
    const double rate =
        13.3 * viscous / (scene_.bodies[member.index].density * scene_.dx * scene_.dx) + drag;
    const double xi = 0.5 * rate / fastest;
    const bool by_damping = xi > 1.0;
    const bool by_contact = contact > omega * omega;
    const char* reason = by_damping   ? "damping of "
                         : by_contact ? "contact of "
                                      : "elastic wave of ";
    limit.limit_to(scene_.dt_safety * 2.0 / fastest * (std::sqrt(1.0 + xi * xi) - xi),
                   reason + member.body->name());
    if (drag > 0.0) limit.limit_to(1.0 / drag, "drag of " + member.body->name());
  }
}

template <class S>
std::vector<double> TotalGroup<S>::elastic_dt() const {
  std::vector<double> out;
  for (const Member& member : members_) out.push_back(member.elastic_dt);
  return out;
}

template <class S>
void TotalGroup<S>::set_elastic_dt(const std::vector<double>& dt) {
  for (std::size_t m = 0; m < members_.size(); ++m) members_[m].elastic_dt = dt[m];
}

template <class S>
void TotalGroup<S>::begin_frame(double time) {
  const double frame_seconds = 1.0 / scene_.fps;
  double pull = scene_.gravity.at(time).norm();
  pull = std::max(pull, scene_.gravity.at(time + frame_seconds).norm());
  term_acceleration_ = 0.0;
  for (Member& member : members_) {
    double own = 0.0;
    if (member.terms->terms().act()) {
      own = member.terms->terms().acceleration_bound(member.body->max_speed());
    }
    member.contact->wake(frame_seconds, pull + own);
    term_acceleration_ = std::max(term_acceleration_, own);
  }
}

template <class S>
void TotalGroup<S>::touch(Arena& arena, double time, double dt) {
  for (Member& member : members_) {
    member.body->clear_loads();
    const TotalSubstep substep{
        time, dt, 0.0, 0.0, scene_.gravity.at(time), member.body->held(time)};
    for (TotalLoad<S>* load : member.loads) load->apply(arena, *member.body, substep);
  }
}

template <class S>
void TotalGroup<S>::step(Arena& arena, double time, double dt, const Vec3d& gravity, int frame,
                         FrameReport& report) {
  for (std::size_t m = 0; m < members_.size(); ++m) {
    Member& member = members_[m];
    TotalSubstep& taken = last_[m];
    taken = {time, dt, 0.0, 0.0, gravity, false};
    if (member.body->releases_between(time - dt, time)) member.last_dt = 0.0;
    if (member.body->held(time)) {
      taken.held = true;
      member.body->step_nodes(arena, 0.0, dt, gravity, time);
      member.last_dt = 0.0;
      continue;
    }
    taken.kick = 0.5 * (member.last_dt + dt);
    member.body->compute_forces(arena, dt, true);
    member.body->step_nodes(arena, taken.kick, dt, gravity, time);
    if (++member.unsmoothed == kSmoothingInterval) {
      member.unsmoothed = 0;
      taken.smoothing = std::min(0.5, kSmoothing * kSmoothingInterval * dt / member.elastic_dt);
      member.body->smooth_velocities(arena, taken.smoothing);
    }
    member.last_dt = dt;
    ++member.since_probe;
    const auto extremes = member.body->extremes();
    member.latest = extremes;
    report.min_volume_ratio =
        std::min(report.min_volume_ratio, static_cast<double>(extremes.min_volume_ratio));
    report.max_volume_ratio =
        std::max(report.max_volume_ratio, static_cast<double>(extremes.max_volume_ratio));
    if (!(extremes.min_volume_ratio > S(0))) fail(member, time, frame);
  }
}

template <class S>
void TotalGroup<S>::nudge(const Nudge& nudge) {
  for (Member& member : members_) {
    if (member.index != nudge.body) continue;
    member.body->nudge(nudge.velocity, nudge.spin);
    member.budget_known = false;
  }
}

template <class S>
void TotalGroup<S>::change(std::size_t body, const RigidChange& change) {
  for (Member& member : members_) {
    if (member.index != body) continue;
    member.body->change(change);
    member.budget_known = false;
    return;
  }
  throw_input("Body " + std::to_string(body) +
              " cannot be moved between frames: it is not in the total Lagrangian formulation.");
}

template <class S>
void TotalGroup<S>::watch_energy(Arena& arena, double time, bool alone, int frame) {
  const Vec3d gravity = scene_.gravity.at(time);
  const double frame_seconds = 1.0 / scene_.fps;
  const bool steady = (scene_.gravity.at(time + frame_seconds) - gravity).isZero(0.0);
  for (Member& member : members_) {
    const Body& body = scene_.bodies[member.index];
    const TotalBody<S>& total = *member.body;
    if (!alone || !steady || member.contact->animated() || !body.pins.empty() ||
        !body.masses.empty() || member.terms->terms().act() || !body.material.traits().elastic()) {
      member.budget_known = false;
      continue;
    }
    const double kinetic = total.kinetic_energy();
    const double elastic = total.elastic_energy(arena, member.last_dt);
    const double height = -gravity.dot(total.mass_moment(member.last_dt) - member.start);
    const double work = member.contact->work();
    const double energy = kinetic + elastic + height;
    const double floor = total.grid().total_mass() * (gravity.norm() * scene_.dx + 1e-12);
    const double slack = kEnergySlack * (kinetic + elastic + std::abs(work) + floor);
    if (!std::isfinite(energy + work)) fail(member, time, frame);
    if (member.budget_known && !(energy <= member.budget + work + slack)) {
      std::ostringstream text;
      text << "Body '" << total.name() << "', frame " << frame << " (" << time << " s): it has "
           << energy - member.budget - work << " J more than it had and was given (" << kinetic
           << " J of motion, " << elastic
           << " J of shape): the step is too long for it. Use a smaller scene.solver.dt_safety, a "
              "smaller particle separation, or formulation 'updated'.";
      throw UnstableError(text.str(), member.index);
    }
    // Not what was given: the error of the work would add up over landings.
    member.budget = energy;
    member.budget_known = true;
  }
}

template <class S>
void TotalGroup<S>::fail(const Member& member, double time, int frame) const {
  const TotalBody<S>& body = *member.body;
  std::uint32_t worst = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::uint32_t p = 0; p < body.particles(); ++p) {
    const auto at = body.point(p);
    const double j = body.deformation_gradient(at).determinant();
    // Written so that what is not a number is found too.
    if (!(std::abs(j) < kNoResult) || !(body.state(at).velocity.norm() < kNoResult)) {
      worst = p;
      least = std::numeric_limits<double>::quiet_NaN();
      break;
    }
    if (j < least) {
      least = j;
      worst = p;
    }
  }
  std::ostringstream text;
  text << "Body '" << body.name() << "', frame " << frame << " (" << time << " s): particle "
       << worst;
  if (std::isfinite(least)) {
    const Vec3d x = body.state(body.point(worst)).position;
    text << " at (" << x[0] << ", " << x[1] << ", " << x[2]
         << ") m is turned inside out (volume ratio " << least << ").";
  } else {
    text << " is not a number.";
  }
  text << " The deformation is larger than this grid can follow: use a smaller particle "
          "separation, a smaller scene.solver.dt_safety, gentler motion, or formulation "
          "'updated' if the body flows or tears.";
  throw UnstableError(text.str(), member.index);
}

template <class S>
void TotalGroup<S>::sample(Arena& arena, std::vector<BodyState>& bodies) const {
  for (const Member& member : members_) member.body->sample(arena, bodies[member.index]);
}

template <class S>
void TotalGroup<S>::report(FrameReport& report) const {
  for (const Member& member : members_) {
    report.max_speed = std::max(report.max_speed, member.body->max_speed());
    report.kinetic_energy += member.body->kinetic_energy();
    report.max_penetration = std::max(report.max_penetration, member.contact->max_penetration());
  }
}

template <class S>
void TotalGroup<S>::save(ByteWriter& out) const {
  for (const Member& member : members_) {
    out.put(member.last_dt);
    out.put(member.elastic_dt);
    out.put(member.unsmoothed);
    out.put(member.since_probe);
    out.put(member.probed);
    out.put(member.latest);
    out.put(member.budget);
    out.put(member.budget_known);
    member.body->save(out);
    member.contact->save(out);
  }
}

template <class S>
void TotalGroup<S>::load(ByteReader& in) {
  for (Member& member : members_) {
    in.get(member.last_dt);
    in.get(member.elastic_dt);
    in.get(member.unsmoothed);
    in.get(member.since_probe);
    in.get(member.probed);
    in.get(member.latest);
    in.get(member.budget);
    in.get(member.budget_known);
    member.body->load(in);
    member.contact->load(in);
  }
}

template <class S>
std::vector<TotalMemberState<S>> TotalGroup<S>::record() const {
  std::vector<TotalMemberState<S>> states;
  for (const Member& member : members_) {
    states.push_back({member.body->record(), member.contact->record(), member.last_dt,
                      member.elastic_dt, member.unsmoothed});
  }
  return states;
}

template <class S>
void TotalGroup<S>::restore(const std::vector<TotalMemberState<S>>& states) {
  for (std::size_t m = 0; m < members_.size(); ++m) {
    members_[m].body->restore(states[m].body);
    members_[m].contact->restore(states[m].contact);
    members_[m].last_dt = states[m].last_dt;
    members_[m].elastic_dt = states[m].elastic_dt;
    members_[m].unsmoothed = states[m].unsmoothed;
  }
}

template struct TotalMemberState<float>;
template struct TotalMemberState<double>;
template class TotalGroup<float>;
template class TotalGroup<double>;

}  // namespace matterfit::mpm
