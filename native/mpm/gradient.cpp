// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/gradient.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.hpp"
#include "mpm/gradient_record.hpp"
#include "mpm/scene_check.hpp"
#include "mpm/stepper.hpp"
#include "mpm/total_group_adjoint.hpp"

namespace matterfit::mpm {
namespace {

/// Share of the progress that the forward pass takes.
constexpr double kForwardShare = 0.3;

void check_adjoints(const Scene& scene) {
  for (const Body& body : scene.bodies) {
    if (is_total(body)) continue;
    throw_input("Body '" + body.name +
                "' is of formulation 'updated', which has no gradient. Set it to 'total' if the "
                "body stays solid, or fit it by differences.");
  }
  if (scene.bodies.size() > 1) {
    throw_input("Bodies '" + scene.bodies[0].name + "' and '" + scene.bodies[1].name +
                "' may touch each other, and contact between bodies has no gradient. Fit each in "
                "a scene of its own, or by differences.");
  }
}

/// A run with its way back. For bodies of another formulation, here is what is asked of a group:
/// forward record(), restore() and Stepper's substep; backward what TotalGroupAdjoint does.
template <class S>
class Run {
  using States = std::vector<TotalMemberState<S>>;

 public:
  Run(const Scene& scene, const std::shared_ptr<Arena>& arena, const Observer& observer,
      const GradientOptions& options, const Interrupter& interrupter)
      : stepper_(scene, arena, options.simulation),
        scene_(stepper_.scene()),
        observer_(observer),
        options_(options),
        interrupter_(interrupter),
        frames_(static_cast<std::size_t>(scene_.end_frame - 1 - scene_.first_frame)),
        record_(options.memory_budget) {
    stepper_.set_schedule(options.schedule);
  }

  RollOut roll_out() {
    forward({}, 1.0);
    return {out_.loss, std::move(out_.schedule)};
  }

  Gradient gradient() {
    record();
    TotalGroupAdjoint<S> total(scene_, stepper_.total(), options_.simulation.target);
    backward(total);
    out_.bodies.resize(scene_.bodies.size());
    out_.colliders.resize(scene_.colliders.size());
    total.collect(out_);
    out_.substeps = log_.size();
    out_.state_bytes = record_.largest();
    out_.peak_bytes = record_.peak();
    return std::move(out_);
  }

 private:
  void forward(const SubstepHooks& hooks, double share) {
    observe();
    for (std::size_t f = 0; f < frames_; ++f) {
      starts_.push_back(log_.size());
      (void)stepper_.advance(interrupter_, hooks);
      out_.schedule.push_back(stepper_.taken());
      observe();
      progress(share * static_cast<double>(f + 1) / static_cast<double>(frames_));
    }
    for (const FrameLoss& loss : losses_) out_.loss += loss.loss;
  }

  /// Forward, with what the way back needs.
  void record() {
    SubstepHooks hooks;
    hooks.before = [&](int k, int substeps) {
      const std::size_t begin = starts_.back();
      if (k == 0) {  // perhaps again
        record_.drop_from(begin);
        log_.resize(begin);
      }
      const std::size_t n = log_.size();
      if (!record_.wants(n)) return;
      States states = stepper_.total().record();
      std::size_t bytes = 0;
      for (const TotalMemberState<S>& state : states) bytes += state.bytes();
      expected_ = begin + static_cast<std::size_t>(substeps) * (frames_ - starts_.size() + 1);
      record_.put(n, std::move(states), bytes, expected_);
      if (n == 0 && known_length() > 0) record_.require(known_length());
    };
    hooks.after = [&] { log_.push_back(stepper_.total().last_substeps()); };
    forward(hooks, kForwardShare);
  }

  /// Asks for the present frame's loss.
  void observe() {
    ObservedFrame frame;
    frame.frame = stepper_.frame();
    frame.time = (frame.frame - scene_.first_frame) / scene_.fps;
    frame.bodies.resize(scene_.bodies.size());
    TotalGroup<S>& total = stepper_.total();
    for (std::size_t m = 0; m < total.size(); ++m) {
      const TotalBody<S>& body = total.body(m);
      ObservedFrame::Body& seen = frame.bodies[total.index(m)];
      seen.positions.resize(body.particles());
      seen.velocities.resize(body.particles());
      stepper_.arena().parallel_for(0, body.particles(), 256, [&](std::size_t p) {
        const auto state = body.point_state(static_cast<std::uint32_t>(p));
        seen.positions[p] = state.position;
        seen.velocities[p] = state.velocity;
      });
    }
    FrameLoss loss;
    loss.bodies.resize(scene_.bodies.size());
    observer_(frame, loss);
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      for (const auto* bars : {&loss.bodies[b].positions, &loss.bodies[b].velocities}) {
        if (!bars->empty() && bars->size() != frame.bodies[b].positions.size()) {
          throw_input("The loss of frame " + std::to_string(frame.frame) + " has " +
                      std::to_string(bars->size()) + " derivatives for the " +
                      std::to_string(frame.bodies[b].positions.size()) + " particles of body '" +
                      scene_.bodies[b].name + "'.");
        }
        cotangent_bytes_ += bars->size() * sizeof(Vec3d);
      }
    }
    losses_.push_back(std::move(loss));
    record_.set_other(
        cotangent_bytes_ + log_.size() * stepper_.total().size() * sizeof(TotalSubstep), expected_);
  }

  /// Substeps of the whole run where they are known before it; else 0.
  [[nodiscard]] std::size_t known_length() const {
    std::size_t sum = 0;
    for (std::size_t f = 0; f < frames_; ++f) {
      const bool scheduled = f < options_.schedule.size();
      const int count = scheduled                    ? options_.schedule[f].substeps
                        : f < scene_.substeps.size() ? scene_.substeps[f]
                                                     : 0;
      if (count <= 0) return 0;
      sum += static_cast<std::size_t>(count);
    }
    return sum;
  }

  void backward(TotalGroupAdjoint<S>& total) {
    std::vector<ContactMemories> after = memories(stepper_.total().record());
    std::size_t frame = frames_;
    total.observe(stepper_.arena(), losses_[frame]);
    std::size_t end = log_.size();
    while (!record_.empty()) {
      auto [begin, first] = record_.take_last();
      std::vector<States> segment{std::move(first)};
      run_again(begin, end, segment);
      while (end > begin) {
        interrupter_.check();
        --end;
        States& before = segment.back();
        total.substep(stepper_.arena(), log_[end], before, after);
        after = memories(before);
        segment.pop_back();
        while (frame > 0 && starts_[frame - 1] == end) {
          total.observe(stepper_.arena(), losses_[--frame]);
        }
      }
      progress(1.0 - (1.0 - kForwardShare) * static_cast<double>(begin) /
                         static_cast<double>(log_.size()));
    }
  }

  /// From the state before `begin` to the one before the last substep before `end`.
  void run_again(std::size_t begin, std::size_t end, std::vector<States>& segment) {
    if (begin + 1 >= end) return;
    stepper_.total().restore(segment.front());
    for (std::size_t n = begin; n + 1 < end; ++n) {
      interrupter_.check();
      const auto f = static_cast<std::size_t>(std::upper_bound(starts_.begin(), starts_.end(), n) -
                                              starts_.begin() - 1);
      stepper_.substep(scene_.first_frame + static_cast<int>(f), out_.schedule[f],
                       static_cast<int>(n - starts_[f]));
      segment.push_back(stepper_.total().record());
      ++out_.recomputed;
    }
  }

  [[nodiscard]] static std::vector<ContactMemories> memories(const States& states) {
    std::vector<ContactMemories> out;
    for (const TotalMemberState<S>& state : states) out.push_back(state.contact.memory);
    return out;
  }

  void progress(double share) const {
    if (options_.progress) options_.progress(share);
  }

  Stepper<S> stepper_;
  const Scene& scene_;
  const Observer& observer_;
  const GradientOptions& options_;
  const Interrupter& interrupter_;
  std::size_t frames_;  ///< that are stepped
  GradientRecord<States> record_;
  std::vector<std::vector<TotalSubstep>> log_;  ///< of every substep
  std::vector<std::size_t> starts_;             ///< first substep of each frame
  std::vector<FrameLoss> losses_;               ///< one more
  std::size_t cotangent_bytes_ = 0;
  std::size_t expected_ = 0;  ///< substeps
  Gradient out_;
};

}  // namespace

template <class S>
RollOut roll_out(const Scene& scene, const std::shared_ptr<Arena>& arena, const Observer& observer,
                 const GradientOptions& options, const Interrupter& interrupter) {
  RollOut out;
  arena->execute([&] { out = Run<S>(scene, arena, observer, options, interrupter).roll_out(); });
  return out;
}

template <class S>
Gradient gradient(const Scene& scene, const std::shared_ptr<Arena>& arena, const Observer& observer,
                  const GradientOptions& options, const Interrupter& interrupter) {
  check_scene(scene);
  check_adjoints(scene);
  Gradient out;
  arena->execute([&] { out = Run<S>(scene, arena, observer, options, interrupter).gradient(); });
  return out;
}

template RollOut roll_out<float>(const Scene&, const std::shared_ptr<Arena>&, const Observer&,
                                 const GradientOptions&, const Interrupter&);
template RollOut roll_out<double>(const Scene&, const std::shared_ptr<Arena>&, const Observer&,
                                  const GradientOptions&, const Interrupter&);
template Gradient gradient<float>(const Scene&, const std::shared_ptr<Arena>&, const Observer&,
                                  const GradientOptions&, const Interrupter&);
template Gradient gradient<double>(const Scene&, const std::shared_ptr<Arena>&, const Observer&,
                                   const GradientOptions&, const Interrupter&);

}  // namespace matterfit::mpm
