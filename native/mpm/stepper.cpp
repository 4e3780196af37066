// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/stepper.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <type_traits>
#include <utility>

#include "base/cancel_check.hpp"
#include "base/clock.hpp"
#include "base/error.hpp"
#include "mpm/body_terms.hpp"
#include "mpm/kernels.hpp"
#include "mpm/scene_check.hpp"
#include "mpm/unstable_error.hpp"

namespace matterfit::mpm {
namespace {

/// The version of saved states.
constexpr std::uint32_t kStateVersion = 4;

constexpr int kMostRetries = 3;
constexpr double kMostSubsteps = 5e6;

}  // namespace

template <class S>
Stepper<S>::Stepper(Scene scene, std::shared_ptr<Arena> arena, const Simulation::Options& options)
    : scene_(std::move(scene)), arena_(std::move(arena)), options_(options) {
  check_scene(scene_);
  const MemoryEstimate needed = Simulation::estimate(scene_);
  if (needed.bytes > options.memory_limit) {
    std::ostringstream text;
    text << "The scene needs about " << (needed.bytes >> 20U) << " MB for " << needed.particles
         << " particles, more than the limit of " << (options.memory_limit >> 20U)
         << " MB. Use a larger particle separation or raise the memory limit.";
    throw_input(text.str());
  }
  frame_ = scene_.first_frame;
  if (scene_.walls) add_walls();
  check_cancel(options.interrupter);
  add_inertia(scene_);
  check_start();
  check_cancel(options.interrupter);
  build_groups();
  options_.interrupter = nullptr;  // it may not live on
}

template <class S>
void Stepper<S>::build_groups() {
  const Kernels<S>& table = kernels<S>(options_.target);
  updated_bodies_.clear();
  body_contacts_.reset();
  updated_.reset();
  renewed_.reset();
  total_ = std::make_unique<TotalGroup<S>>(scene_, table, options_.interrupter);
  renewed_bodies_.clear();
  for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
    if (is_renewed(scene_.bodies[i])) {
      renewed_bodies_.push_back(i);
    } else if (is_updated(scene_.bodies[i])) {
      updated_bodies_.push_back(i);
    }
  }
  if (!renewed_bodies_.empty()) {
    renewed_ = std::make_unique<RenewedGroup<S>>(
        scene_, renewed_bodies_, renewed_kernels<S>(options_.target), options_.memory_limit);
  }
  if (!updated_bodies_.empty()) {
    updated_ = std::make_unique<UpdatedGroup<S>>(scene_, updated_bodies_, table,
                                                 options_.memory_limit, options_.interrupter);
  }
  check_cancel(options_.interrupter);
  if constexpr (std::is_same_v<S, float>) {
    std::vector<BodyContacts::Member> members;
    for (std::size_t m = 0; m < total_->size(); ++m) {
      members.push_back({total_->index(m), &total_->body(m)});
    }
    body_contacts_ = std::make_unique<BodyContacts>(scene_, members, particle_bodies(),
                                                    renewed_ ? renewed_bodies_ : updated_bodies_);
  } else if (total_->size() > 0 && scene_.bodies.size() > 1) {
    throw_input(
        "In double precision a scene has one body of formulation 'total', or bodies that are all "
        "'updated'.");
  }
}

template <class S>
bool Stepper<S>::hand_over(const std::string& before, std::size_t body) {
  const Body& whole = scene_.bodies[body];
  if (!options_.hand_over || updated_ || renewed_ || whole.formulation != Formulation::kAuto ||
      !whole.pins.empty() || !whole.masses.empty() || !whole.material.maxwell.empty()) {
    return false;
  }
  load(before);
  std::size_t member = 0;
  while (total_->index(member) != body) ++member;
  std::vector<TotalMemberState<S>> others = total_->record();
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(member));
  const TotalBody<S>& moving = total_->body(member);
  Body taken = whole;
  taken.formulation = Formulation::kUpdated;
  taken.velocity = taken.spin = Vec3d::Zero();
  taken.particle_velocities.resize(taken.rest.size());
  taken.deformation_gradients.resize(taken.rest.size());
  taken.velocity_gradients.resize(taken.rest.size());
  arena_->parallel_for(0, taken.rest.size(), 256, [&](std::size_t p) {
    const auto at = moving.point(static_cast<std::uint32_t>(p));
    const auto now = moving.state(at);
    taken.rest[p] = now.position;
    taken.particle_velocities[p] = now.velocity;
    taken.deformation_gradients[p] = moving.deformation_gradient(at);
    taken.velocity_gradients[p] = moving.velocity_gradient(at);
  });
  scene_.bodies[body] = std::move(taken);
  handed_ = static_cast<std::uint32_t>(body);
  build_groups();
  total_->restore(others);
  return true;
}

/// Closed walls touch like any other collider.
template <class S>
void Stepper<S>::add_walls() {
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      const double at = side < 0 ? scene_.walls->low[axis] : scene_.walls->high[axis];
      if (!std::isfinite(at)) continue;
      Vec3d point = Vec3d::Zero();
      Vec3d normal = Vec3d::Zero();
      point[axis] = at;
      normal[axis] = -side;
      scene_.colliders.push_back(
          shape::make_plane(std::string("wall ") + (side < 0 ? "-" : "+") + "xyz"[axis],
                            scene_.walls->contact, point, normal));
    }
  }
}

/// A body that starts inside a collider by a layer of particles or more would be shot out of it, or
/// torn: say so instead. Bodies with pins may be set into what holds them.
template <class S>
void Stepper<S>::check_start() const {
  constexpr std::size_t kMostQueries = 20'000;
  // In cells. Particles lie a quarter of one, half their separation, inside the body's surface: a
  // body may rest in a collider by five sixths of a particle, which takes many substeps; from nine
  // tenths on it is torn.
  constexpr double kDeepestStart = 1.0 / 6.0;
  constexpr double kHalfParticle = 0.25;
  for (const Body& body : scene_.bodies) {
    if (!body.pins.empty()) continue;
    const std::size_t step = 1 + body.rest.size() / kMostQueries;
    for (const shape::ColliderPtr& collider : scene_.colliders) {
      double deepest = 0.0;
      Vec3d where = Vec3d::Zero();
      for (std::size_t p = 0; p < body.rest.size(); p += step) {
        const double depth = -collider->closest(body.rest[p], 0.0).distance;
        if (depth <= deepest) continue;
        deepest = depth;
        where = body.rest[p];
      }
      if (deepest <= kDeepestStart * scene_.dx) continue;
      std::ostringstream text;
      text << "Body '" << body.name << "' starts up to " << deepest + kHalfParticle * scene_.dx
           << " m inside '" << collider->name() << "', at (" << where[0] << ", " << where[1] << ", "
           << where[2] << ") m. Move one of them so that they touch at most.";
      throw_input(text.str());
    }
  }
}

/// A particle more than a cell beyond a wall has broken through.
template <class S>
void Stepper<S>::check_walls(const FrameState& state) const {
  if (!scene_.walls) return;
  const Vec3d low = scene_.walls->low - Vec3d::Constant(scene_.dx);
  const Vec3d high = scene_.walls->high + Vec3d::Constant(scene_.dx);
  for (std::size_t b = 0; b < state.bodies.size(); ++b) {
    const auto& positions = state.bodies[b].positions;
    for (std::size_t p = 0; p < positions.size(); ++p) {
      const Vec3d x = positions[p].template cast<double>();
      if ((x - low).minCoeff() >= 0.0 && (high - x).minCoeff() >= 0.0) continue;
      std::ostringstream text;
      text << "Body '" << scene_.bodies[b].name << "', frame " << state.frame << ": particle " << p
           << " at (" << x[0] << ", " << x[1] << ", " << x[2]
           << ") m is more than a cell beyond the walls. Start the body inside them, raise the "
              "walls' contact stiffness, or use gentler motion.";
      throw_compute(text.str());
    }
  }
}

template <class S>
StepLimit Stepper<S>::choose_step(double time, const Interrupter& interrupter) {
  StepLimit step;
  if (scene_.dt > 0.0) step.limit_to(scene_.dt, "scene.solver.dt");
  typename TotalGroup<S>::OtherContact between;
  if (body_contacts_) between = {body_contacts_->any(), body_contacts_->frequency_squared()};
  total_->limit_step(*arena_, time, between, step, interrupter);
  if (!(scene_.dt > 0.0) && between.frequency_squared > 0.0) {
    // Bodies that are held, and updated ones, feel it too.
    step.limit_to(scene_.dt_safety * std::sqrt(2.0 / between.frequency_squared),
                  "contact between bodies");
  }
  if (updated_) {
    const auto [dt, reason] = updated_->begin_frame(time);
    if (!(scene_.dt > 0.0)) step.limit_to(scene_.dt_safety * dt, reason);
  }
  if (renewed_ && !(scene_.dt > 0.0)) {
    const auto [dt, reason] = renewed_->limit_step(time);
    step.limit_to(scene_.dt_safety * dt, reason);
  }
  return step;
}

/// How many substeps a frame takes, as a number that may be too large for an int.
template <class S>
double Stepper<S>::substeps(const StepLimit& step) const {
  return std::max(1.0, std::ceil(1.0 / (scene_.fps * step.dt) * (1.0 - 1e-12)));
}

/// The substeps of the present frame, where the scene sets them; else 0.
template <class S>
int Stepper<S>::fixed_substeps() const {
  const auto k = static_cast<std::size_t>(frame_ - scene_.first_frame);
  return k < scene_.substeps.size() ? scene_.substeps[k] : 0;
}

template <class S>
void Stepper<S>::begin_frame(int substeps, const std::optional<std::vector<double>>& renewals) {
  total_->begin_frame(time_of(frame_));
  if (renewed_) renewed_->begin_frame(time_of(frame_), substeps, renewals);
  if (body_contacts_) body_contacts_->wake();
}

template <class S>
void Stepper<S>::step(double time, double dt, FrameReport& report) {
  const Vec3d gravity = scene_.gravity.at(time);
  total_->touch(*arena_, time, dt);
  if (body_contacts_ && body_contacts_->any()) {
    double pull = total_->term_acceleration();
    if (const auto* others = particle_bodies()) {
      pull = std::max(pull, others->term_acceleration());
    }
    body_contacts_->apply(*arena_, time, dt, gravity.norm() + pull, 1.0 / scene_.fps);
  }
  total_->step(*arena_, time, dt, gravity, frame_, report);
  if (updated_) {
    const auto extremes = updated_->step(*arena_, time, dt, gravity, record_);
    report.min_volume_ratio = std::min(report.min_volume_ratio, extremes.first);
    report.max_volume_ratio = std::max(report.max_volume_ratio, extremes.second);
  }
  if (renewed_) {
    const auto [least, most] = renewed_->step(*arena_, time, dt, gravity);
    report.min_volume_ratio = std::min(report.min_volume_ratio, least);
    report.max_volume_ratio = std::max(report.max_volume_ratio, most);
  }
}

template <class S>
void Stepper<S>::substep(int frame, const FrameSchedule& plan, int k) {
  frame_ = frame;
  if (k == 0) {
    total_->set_elastic_dt(plan.elastic_dt);
    if (updated_) (void)updated_->begin_frame(time_of(frame_));
    begin_frame(plan.substeps, plan.renewals);
  }
  const double dt = 1.0 / (scene_.fps * plan.substeps);
  FrameReport report;
  step(time_of(frame_) + k * dt, dt, report);
}

template <class S>
void Stepper<S>::set_schedule(Schedule schedule) {
  for (std::size_t f = 0; f < schedule.size(); ++f) {
    if (schedule[f].substeps >= 1 && schedule[f].elastic_dt.size() == total_->size()) continue;
    throw_input("The schedule's frame " + std::to_string(f) + " has " +
                std::to_string(schedule[f].substeps) + " substeps, and limits for " +
                std::to_string(schedule[f].elastic_dt.size()) +
                " total Lagrangian bodies; the scene has " + std::to_string(total_->size()) +
                ". Take the schedule of a run of this scene.");
  }
  schedule_ = std::move(schedule);
}

template <class S>
FrameReport Stepper<S>::advance(const Interrupter& interrupter, const SubstepHooks& hooks) {
  for (const Nudge& nudge : scene_.nudges) {
    if (nudge.frame == frame_) total_->nudge(nudge);
  }
  const auto at = static_cast<std::size_t>(frame_ - scene_.first_frame);
  const bool scheduled = at < schedule_.size();
  StepLimit step;
  int fixed = 0;
  std::optional<std::vector<double>> renewals;
  if (scheduled) {
    fixed = schedule_[at].substeps;
    renewals = schedule_[at].renewals;
    step = {1.0 / (scene_.fps * fixed), "schedule"};
    total_->set_elastic_dt(schedule_[at].elastic_dt);
    if (updated_) (void)updated_->begin_frame(time_of(frame_));
  } else {
    step = choose_step(time_of(frame_), interrupter);
    fixed = fixed_substeps();
    if (fixed > 0) {
      step = {1.0 / (scene_.fps * fixed), "scene.substeps"};
      if (at < scene_.renewals.size()) renewals = scene_.renewals[at];
    }
  }
  const bool may_retry = !(scene_.dt > 0.0) && fixed == 0;
  std::string before = may_retry ? save() : "";  // with the limits just found
  double count = fixed > 0 ? fixed : substeps(step);
  if (may_retry && renewed_) count = renewed_->whole_substeps(time_of(frame_), count);
  if (!(count < kMostSubsteps)) {
    // No whole number holds what a modulus of 1e30 asks for.
    throw_compute("Frame " + std::to_string(frame_) + " would need " +
                  (count < 1e15 ? std::to_string(std::llround(count))
                                : "more than " + std::to_string(std::llround(kMostSubsteps))) +
                  " substeps (" + step.reason +
                  "). Soften the material, use a larger particle separation, or override "
                  "scene.solver.dt.");
  }
  FrameReport report;
  // A frame that fails is tried again with half the substep before the run gives up: a hard
  // impact can stiffen the body within a frame. What no step of this formulation can follow goes on
  // in the other one.
  std::string note;
  for (int attempt = 0;; ++attempt) {
    report = FrameReport{};
    report.substeps = static_cast<int>(count);
    report.dt = 1.0 / (scene_.fps * report.substeps);
    report.dt_limit = step.reason + (attempt > 0 ? ", halved after a failed try" : "");
    try {
      begin_frame(report.substeps, renewals);
      for (int k = 0; k < report.substeps; ++k) {
        interrupter.check();
        if (hooks.before) hooks.before(k, report.substeps);
        this->step(time_of(frame_) + k * report.dt, report.dt, report);
        if (hooks.after) hooks.after();
      }
      if (!scheduled) {
        const bool alone = !body_contacts_ || !body_contacts_->any();
        total_->watch_energy(*arena_, time_of(frame_), alone, frame_);
      }
      break;
    } catch (const UnstableError& error) {
      if (!may_retry) throw;
      if (attempt < kMostRetries && 2.0 * count <= kMostSubsteps) {
        load(before);
        count *= 2.0;
        continue;
      }
      if (!error.body() || !hand_over(before, *error.body())) throw;
      note = "Body '" + scene_.bodies[*error.body()].name + "' deformed in frame " +
             std::to_string(frame_) +
             " more than the total Lagrangian formulation can follow, and goes on in the updated "
             "one from there, which damps motion. A smaller particle separation or a stiffer "
             "material would hold it; formulation 'updated' does the same from the start.";
      step = choose_step(time_of(frame_), interrupter);
      count = substeps(step);
      before = save();
      attempt = -1;
    }
  }
  report.note = note;
  ++frame_;
  report.frame = frame_;
  total_->report(report);
  if (updated_) updated_->report(report);
  if (renewed_) renewed_->report(report);
  taken_ = {report.substeps, total_->elastic_dt(), report.renewals};
  if (scene_.walls) check_walls(state());
  return report;
}

template <class S>
SubstepCost Stepper<S>::measure(double seconds, const Interrupter& interrupter) {
  // While everything is held nothing is computed: the price is that of what follows.
  const auto held = [&] { return !updated_ && !renewed_ && total_->all_held(time_of(frame_)); };
  while (held() && frame_ + 1 < scene_.end_frame) ++frame_;
  const double count = substeps(choose_step(time_of(frame_), interrupter));
  SubstepCost cost;
  cost.dt = 1.0 / (scene_.fps * count);
  FrameReport report;
  begin_frame(static_cast<int>(count), {});
  const auto begin = Clock::now();
  int done = 0;
  double spent = 0.0;
  while (done < count && (done == 0 || spent < seconds)) {
    step(time_of(frame_) + done * cost.dt, cost.dt, report);
    ++done;
    spent = seconds_since(begin);
  }
  cost.seconds = spent / done;
  return cost;
}

template <class S>
FrameState Stepper<S>::state() const {
  FrameState out;
  out.frame = frame_;
  out.time = time_of(frame_);
  out.bodies.resize(scene_.bodies.size());
  total_->sample(*arena_, out.bodies);
  if (updated_) updated_->sample(out.bodies);
  if (renewed_) renewed_->sample(*arena_, out.bodies);
  return out;
}

template <class S>
ObservedFrame Stepper<S>::observe(bool deformation_gradients) const {
  ObservedFrame out;
  out.frame = frame_;
  out.time = time_of(frame_);
  out.bodies.resize(scene_.bodies.size());
  for (std::size_t m = 0; m < total_->size(); ++m) {
    const TotalBody<S>& body = total_->body(m);
    ObservedFrame::Body& seen = out.bodies[total_->index(m)];
    seen.positions.resize(body.particles());
    seen.velocities.resize(body.particles());
    if (deformation_gradients) seen.deformation_gradients.resize(body.particles());
    arena_->parallel_for(0, body.particles(), 256, [&](std::size_t p) {
      const auto point = body.point(static_cast<std::uint32_t>(p));
      const auto state = body.state(point);
      seen.positions[p] = state.position;
      seen.velocities[p] = state.velocity;
      if (deformation_gradients) {
        seen.deformation_gradients[p] = body.deformation_gradient(point);
      }
    });
  }
  for (std::size_t m = 0; m < updated_bodies_.size(); ++m) {
    ObservedFrame::Body& seen = out.bodies[updated_bodies_[m]];
    for (const UpdatedParticle& particle : updated_->particles(m)) {
      seen.positions.push_back(particle.position);
      seen.velocities.push_back(particle.velocity);
      if (deformation_gradients) {
        seen.deformation_gradients.push_back(particle.deformation_gradient);
      }
    }
  }
  if (renewed_) renewed_->observe(*arena_, deformation_gradients, out.bodies);
  return out;
}

template <class S>
std::string Stepper<S>::save() const {
  ByteWriter out;
  out.put(kStateVersion);
  out.put(frame_);
  out.put(handed_);
  total_->save(out);
  if (updated_) updated_->save(out);
  if (renewed_) renewed_->save(out);
  if (body_contacts_) body_contacts_->save(out);
  return out.take();
}

template <class S>
void Stepper<S>::load(const std::string& bytes) {
  ByteReader in(bytes);
  std::uint32_t version = 0;
  in.get(version);
  if (version != kStateVersion)
    throw_input("The checkpoint is of another version. Simulate again.");
  in.get(frame_);
  std::uint32_t handed = kNoBody;
  in.get(handed);
  if (handed != handed_) {
    // The rest shape does not matter: an updated body's state is all in the bytes.
    if (handed >= scene_.bodies.size() || handed_ != kNoBody) {
      throw_input("The checkpoint is of another scene. Simulate again.");
    }
    scene_.bodies[handed].formulation = Formulation::kUpdated;
    handed_ = handed;
    build_groups();
  }
  total_->load(in);
  if (updated_) updated_->load(in);
  if (renewed_) renewed_->load(in);
  if (body_contacts_) body_contacts_->load(in);
  in.expect_end();
}

template class Stepper<float>;
template class Stepper<double>;

}  // namespace matterfit::mpm
