// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/gradient_tape.hpp"

#include <algorithm>
#include <utility>

#include "mpm/initial_velocity.hpp"
#include "mpm/state_bytes.hpp"

namespace matterfit::mpm {

template <class S>
std::size_t TotalTape<S>::bytes(const State& state) {
  std::size_t bytes = 0;
  for (const TotalMemberState<S>& member : state) bytes += member.bytes();
  return bytes;
}

template <class S>
std::vector<ContactMemories> TotalTape<S>::memories(const State& state) {
  std::vector<ContactMemories> out;
  for (const TotalMemberState<S>& member : state) out.push_back(member.contact.memory);
  return out;
}

template <class S>
void TotalTape<S>::turn() {
  adjoint_ =
      std::make_unique<TotalGroupAdjoint<S>>(stepper_.scene(), stepper_.total(), target_, rates_);
  after_ = memories(stepper_.total().record());
}

template <class S>
void TotalTape<S>::back(std::size_t begin, std::size_t end, State first, const StepAgain& again,
                        const SubstepPassed& passed) {
  std::vector<State> states{std::move(first)};
  if (begin + 1 < end) stepper_.total().restore(states.front());
  for (std::size_t n = begin; n + 1 < end; ++n) {
    again(n);
    states.push_back(stepper_.total().record());
  }
  while (end > begin) {
    --end;
    adjoint_->substep(stepper_.arena(), log_[end], states.back(), after_);
    after_ = memories(states.back());
    states.pop_back();
    passed(end);
  }
}

template <class S>
std::string UpdatedTape<S>::state() const {
  ByteWriter out;
  out.reserve(state_bytes_);
  stepper_.updated()->save(out);
  stepper_.updated()->save_sleep(out);
  std::string bytes = out.take();
  bytes.shrink_to_fit();
  state_bytes_ = bytes.size();
  return bytes;
}

template <class S>
std::size_t UpdatedTape<S>::bytes(const State& state) const {
  return std::max(state.size(), largest_);
}

template <class S>
void UpdatedTape<S>::before_substep() {
  if (!keeps_) return;
  records_.emplace_back();
  stepper_.keep(&records_.back());
}

template <class S>
void UpdatedTape<S>::after_substep() {
  if (!keeps_) return;
  stepper_.keep(nullptr);
  const std::size_t bytes = records_.back().bytes();
  largest_ = std::max(largest_, bytes);
  record_bytes_ += bytes;
  ++finished_;
}

template <class S>
void UpdatedTape<S>::forget_from(std::size_t substep) {
  stepper_.keep(nullptr);
  // The substep that failed has added nothing to the sum.
  if (finished_ < records_.size()) records_.pop_back();
  while (records_.size() > substep) {
    record_bytes_ -= records_.back().bytes();
    records_.pop_back();
  }
  finished_ = records_.size();
}

template <class S>
void UpdatedTape<S>::give_up() {
  keeps_ = false;
  records_.clear();
  record_bytes_ = 0;
  finished_ = 0;
}

template <class S>
void UpdatedTape<S>::turn() {
  adjoint_ = std::make_unique<UpdatedAdjoint<S>>(stepper_.scene(), stepper_.updated_bodies(),
                                                 updated_adjoint_kernels<S>(target_), rates_);
  bar_ = adjoint_->zero(published_);
}

template <class S>
void UpdatedTape<S>::observe(const FrameLoss& loss) {
  const std::vector<std::size_t>& bodies = stepper_.updated_bodies();
  for (std::size_t m = 0; m < bodies.size(); ++m) {
    const FrameLoss::Body& body = loss.bodies[bodies[m]];
    const auto add = [](std::array<S, 3>& sum, const Vec3d& bar) {
      for (std::size_t c = 0; c < 3; ++c) sum[c] += static_cast<S>(bar[static_cast<int>(c)]);
    };
    std::vector<UpdatedParticleBar<S>>& particles = bar_.bodies[m].particles;
    for (std::size_t p = 0; p < body.positions.size(); ++p) {
      add(particles[p].position, body.positions[p]);
    }
    for (std::size_t p = 0; p < body.velocities.size(); ++p) {
      add(particles[p].velocity, body.velocities[p]);
    }
    for (std::size_t p = 0; p < body.deformation_gradients.size(); ++p) {
      for (std::size_t i = 0; i < 9; ++i) {
        particles[p].h[i] += static_cast<S>(
            body.deformation_gradients[p](static_cast<int>(i / 3), static_cast<int>(i % 3)));
      }
    }
  }
}

template <class S>
void UpdatedTape<S>::back(std::size_t begin, std::size_t end, State first, const StepAgain& again,
                          const SubstepPassed& passed) {
  if (!keeps_) {
    ByteReader in(first);
    stepper_.updated()->load(in);
    stepper_.updated()->load_sleep(in);
    in.expect_end();
    State().swap(first);
    for (std::size_t n = begin; n < end; ++n) {
      records_.emplace_back();
      stepper_.keep(&records_.back());
      again(n);
    }
    stepper_.keep(nullptr);
  }
  while (end > begin) {
    --end;
    adjoint_->substep(stepper_.arena(), records_.back(), bar_);
    records_.pop_back();
    passed(end);
  }
}

namespace {

/// Puts together the gradient of one body, the n-th of the adjoint's and `of` in the scene, with
/// the cotangents of its start.
template <class Adjoint, class Cotangents>
void collect_body(const Scene& scene, const Adjoint& adjoint, const Cotangents& bar, std::size_t n,
                  std::size_t of, StartCotangents start, Gradient& out) {
  BodyGradient& body = out.bodies[of];
  body.material = adjoint.material_gradient(n, bar);
  body.density = start.log_density / scene.bodies[of].density;
  body.offset = start.offset;
  body.rotation = start.rotation;
  body.velocity = start.velocity;
  body.spin = start.spin;
  body.particle_velocities = std::move(start.particle_velocities);
  adjoint.add_terms(n, bar, body.density, out.effects, body.material);
  const TermCotangents& terms = bar.bodies[n].terms;
  body.offset += terms.rest;
  body.rotation += terms.rest_turn - center_of_volume(scene.bodies[of]).cross(terms.rest);
}

template <class Cotangents>
void collect_scene(const Cotangents& bar, Gradient& out) {
  out.gravity += bar.gravity;
  for (std::size_t c = 0; c < out.colliders.size(); ++c) out.colliders[c] += bar.colliders[c];
}

}  // namespace

template <class S>
void UpdatedTape<S>::collect(const std::vector<Vec3d>& /*observed*/, Gradient& out) const {
  const std::vector<std::size_t>& bodies = stepper_.updated_bodies();
  for (std::size_t m = 0; m < bodies.size(); ++m) {
    collect_body(stepper_.scene(), *adjoint_, bar_, m, bodies[m],
                 adjoint_->start(stepper_.arena(), m, bar_), out);
  }
  collect_scene(bar_, out);
}

template <class S>
RenewedState<S> RenewedTape<S>::state() {
  State state = stepper_.renewed()->record();
  // All states between two renewals share one.
  if (last_ != state.reference) references_ += state.reference->bytes();
  last_ = state.reference;
  return state;
}

template <class S>
void RenewedTape<S>::before_substep() {
  stepper_.renewed()->follow(&log_.emplace_back());
}

template <class S>
void RenewedTape<S>::after_substep() {
  stepper_.renewed()->follow(nullptr);
  touches_ += log_.back().touches.size();
}

template <class S>
void RenewedTape<S>::forget_from(std::size_t substep) {
  stepper_.renewed()->follow(nullptr);
  log_.resize(substep);
  touches_ = 0;
  for (const RenewedSubstep& taken : log_) touches_ += taken.touches.size();
}

template <class S>
std::size_t RenewedTape<S>::log_bytes() const {
  return log_.size() * sizeof(RenewedSubstep) + touches_ * sizeof(RenewedTouch) + references_;
}

template <class S>
void RenewedTape<S>::turn() {
  adjoint_ = std::make_unique<RenewedAdjoint<S>>(stepper_.scene(), stepper_.renewed_bodies(),
                                                 renewed_adjoint_kernels<S>(target_), rates_);
  after_ = state();
  bar_ = adjoint_->zero(after_);
}

template <class S>
void RenewedTape<S>::back(std::size_t begin, std::size_t end, State first, const StepAgain& again,
                          const SubstepPassed& passed) {
  RenewedGroup<S>& group = *stepper_.renewed();
  std::vector<State> states{std::move(first)};
  if (begin + 1 < end) group.restore(states.front());
  for (std::size_t n = begin; n + 1 < end; ++n) {
    again(n);
    states.push_back(group.record());
  }
  while (end > begin) {
    --end;
    const RenewedSubstep& taken = log_[end];
    if (adjoint_->looks_into(taken)) {
      std::vector<double> pushed;
      group.restore(states.back());
      group.look_into(&pushed);
      again(end);
      group.look_into(nullptr);
      const State left = group.record();
      if (taken.renewed) adjoint_->renewal(stepper_.arena(), left, after_, bar_);
      adjoint_->substep(stepper_.arena(), taken, states.back(), pushed, left, bar_);
    } else {
      adjoint_->substep(stepper_.arena(), taken, states.back(), after_.velocity, after_, bar_);
    }
    after_ = std::move(states.back());
    states.pop_back();
    passed(end);
  }
}

template <class S>
void RenewedTape<S>::collect(const std::vector<Vec3d>& /*observed*/, Gradient& out) const {
  const std::vector<std::size_t>& bodies = stepper_.renewed_bodies();
  for (std::size_t m = 0; m < bodies.size(); ++m) {
    collect_body(stepper_.scene(), *adjoint_, bar_, m, bodies[m],
                 adjoint_->start(stepper_.arena(), m, after_, bar_), out);
  }
  collect_scene(bar_, out);
}

template class TotalTape<float>;
template class TotalTape<double>;
template class UpdatedTape<float>;
template class UpdatedTape<double>;
template class RenewedTape<float>;
template class RenewedTape<double>;

}  // namespace matterfit::mpm
