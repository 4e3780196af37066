// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/gradient.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.hpp"
#include "mpm/gradient_record.hpp"
#include "mpm/gradient_tape.hpp"
#include "mpm/scene_check.hpp"
#include "mpm/stepper.hpp"

namespace matterfit::mpm {
namespace {

/// Share of the progress that the forward pass takes.
constexpr double kForwardShare = 0.3;

/// None is total Lagrangian.
[[nodiscard]] bool all_of_particles(const Scene& scene) {
  return std::none_of(scene.bodies.begin(), scene.bodies.end(),
                      [](const Body& body) { return is_total(body); });
}

void check_adjoints(const Scene& scene) {
  if (!scene.nudges.empty()) throw_input("A scene with nudges has no gradient.");
  if (all_of_particles(scene) || scene.bodies.size() == 1) return;
  const auto total = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                  [](const Body& body) { return is_total(body); });
  const Body& other = scene.bodies[total == scene.bodies.begin() ? 1 : 0];
  throw_input("Bodies '" + total->name + "' and '" + other.name +
              "' may touch each other, and contact between bodies has no gradient where one of "
              "them is of formulation 'total'. Fit each in a scene of its own, set all to "
              "'updated', or fit by differences.");
}

/// A run with its way back, of bodies of one formulation.
template <class S, class Tape>
class Run {
 public:
  Run(const Scene& scene, const std::shared_ptr<Arena>& arena, const Observer& observer,
      const GradientOptions& options, const Interrupter& interrupter)
      : stepper_(scene, arena, options.simulation),
        tape_(stepper_, options),
        scene_(stepper_.scene()),
        observer_(observer),
        options_(options),
        interrupter_(interrupter),
        frames_(static_cast<std::size_t>(scene_.end_frame - 1 - scene_.first_frame)),
        record_(options.memory_budget, Tape::kFirstInterval),
        turn_(scene_.bodies.size(), Vec3d::Zero()) {
    stepper_.set_schedule(options.schedule);
    record_.reserve_segment(!tape_.has_all());
  }

  RollOut roll_out() {
    goes_back_ = false;
    forward({}, 1.0);
    return {out_.loss, std::move(out_.schedule)};
  }

  Gradient gradient() {
    record();
    backward();
    out_.bodies.resize(scene_.bodies.size());
    out_.colliders.resize(scene_.colliders.size());
    for (const effects::Effect& effect : scene_.effects) {
      out_.effects.emplace_back(effect.values.size(), 0.0);
    }
    tape_.collect(turn_, out_);
    out_.substeps = substeps_;
    out_.peak_bytes = std::max(peak_, record_.peak());
    return std::move(out_);
  }

 private:
  void forward(const SubstepHooks& hooks, double share) {
    observe();
    for (std::size_t f = 0; f < frames_; ++f) {
      starts_.push_back(substeps_);
      (void)stepper_.advance(interrupter_, hooks);
      out_.schedule.push_back(stepper_.taken());
      observe();
      progress(share * static_cast<double>(f + 1) / static_cast<double>(frames_));
    }
  }

  /// Forward, with what the way back needs.
  void record() {
    SubstepHooks hooks;
    hooks.before = [&](int k, int substeps) {
      const std::size_t begin = starts_.back();
      if (k == 0) {  // perhaps again
        record_.drop_from(begin);
        tape_.forget_from(begin);
        substeps_ = begin;
      }
      if (record_.wants(substeps_)) {
        make_room(record_.largest());
        auto state = tape_.state();
        const std::size_t bytes = tape_.bytes(state);
        expected_ = begin + static_cast<std::size_t>(substeps) * (frames_ - starts_.size() + 1);
        make_room(bytes);
        record_.put(substeps_, std::move(state), bytes, expected_);
        if (substeps_ == 0 && known_length() > 0 && !tape_.has_all()) {
          record_.require(known_length());
        }
      }
      tape_.before_substep();
    };
    hooks.after = [&] {
      ++substeps_;
      tape_.after_substep();
      make_room(0);
      note_peak();
    };
    forward(hooks, kForwardShare);
    out_.state_bytes = record_.largest();
    if (tape_.has_all() && substeps_ > 0) {
      out_.state_bytes = (tape_.spare_bytes() + substeps_ - 1) / substeps_;
    }
  }

  /// What need not be kept goes before a state does.
  void make_room(std::size_t bytes) {
    if (record_.held() + bytes + tape_.spare_bytes() <= options_.memory_budget) return;
    tape_.give_up();
    record_.reserve_segment(true);
  }

  void check_derivatives(const ObservedFrame& frame, std::size_t body, std::size_t count) const {
    const std::size_t particles = frame.bodies[body].positions.size();
    if (count == 0 || count == particles) return;
    throw_input("The loss of frame " + std::to_string(frame.frame) + " has " +
                std::to_string(count) + " derivatives for the " + std::to_string(particles) +
                " particles of body '" + scene_.bodies[body].name + "'.");
  }

  /// The derivative by a turn of F, R F Rᵀ.
  static Vec3d turn_of(const std::vector<Mat3d>& f, const std::vector<Mat3d>& bars) {
    Vec3d sum = Vec3d::Zero();
    for (std::size_t i = 0; i < bars.size(); ++i) {
      const Mat3d m = f[i] * bars[i].transpose() - bars[i].transpose() * f[i];
      sum += Vec3d(m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0));
    }
    return sum;
  }
  /// Σ a × ā.
  static Vec3d turn_of(const std::vector<Vec3d>& vectors, const std::vector<Vec3d>& bars) {
    Vec3d sum = Vec3d::Zero();
    for (std::size_t i = 0; i < bars.size(); ++i) sum += vectors[i].cross(bars[i]);
    return sum;
  }

  void note_peak() { peak_ = std::max(peak_, record_.held() + tape_.spare_bytes()); }

  /// Asks for the present frame's loss.
  void observe() {
    const ObservedFrame frame = stepper_.observe(options_.deformation_gradients);
    FrameLoss loss;
    loss.bodies.resize(scene_.bodies.size());
    observer_(frame, loss);
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      const FrameLoss::Body& of = loss.bodies[b];
      for (const std::size_t count :
           {of.positions.size(), of.velocities.size(), of.deformation_gradients.size()}) {
        check_derivatives(frame, b, count);
      }
      cotangent_bytes_ += (of.positions.capacity() + of.velocities.capacity()) * sizeof(Vec3d) +
                          of.deformation_gradients.capacity() * sizeof(Mat3d);
    }
    out_.loss += loss.loss;
    if (!goes_back_) return;
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      turn_[b] +=
          turn_of(frame.bodies[b].positions, loss.bodies[b].positions) +
          turn_of(frame.bodies[b].velocities, loss.bodies[b].velocities) +
          turn_of(frame.bodies[b].deformation_gradients, loss.bodies[b].deformation_gradients);
    }
    losses_.push_back(std::move(loss));
    const std::size_t other = cotangent_bytes_ + tape_.log_bytes();
    make_room(other - record_.other());
    record_.set_other(other, expected_);
    note_peak();
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

  void backward() {
    tape_.turn();
    std::size_t frame = frames_;
    tape_.observe(losses_[frame]);
    const StepAgain again = [&](std::size_t n) {
      interrupter_.check();
      const auto f = static_cast<std::size_t>(std::upper_bound(starts_.begin(), starts_.end(), n) -
                                              starts_.begin() - 1);
      stepper_.substep(scene_.first_frame + static_cast<int>(f), out_.schedule[f],
                       static_cast<int>(n - starts_[f]));
      ++out_.recomputed;
    };
    const SubstepPassed passed = [&](std::size_t n) {
      interrupter_.check();
      while (frame > 0 && starts_[frame - 1] == n) tape_.observe(losses_[--frame]);
    };
    std::size_t end = substeps_;
    while (!record_.empty()) {
      auto [begin, state] = record_.take_last();
      tape_.back(begin, end, std::move(state), again, passed);
      end = begin;
      progress(1.0 -
               (1.0 - kForwardShare) * static_cast<double>(begin) / static_cast<double>(substeps_));
    }
  }

  void progress(double share) const {
    if (options_.progress) options_.progress(share);
  }

  Stepper<S> stepper_;
  Tape tape_;
  const Scene& scene_;
  const Observer& observer_;
  const GradientOptions& options_;
  const Interrupter& interrupter_;
  std::size_t frames_;  ///< that are stepped
  GradientRecord<typename Tape::State> record_;
  std::size_t substeps_ = 0;         ///< taken
  std::vector<std::size_t> starts_;  ///< first substep of each frame
  bool goes_back_ = true;
  std::vector<FrameLoss> losses_;  ///< one more; none where the run does not go back
  std::vector<Vec3d> turn_;        ///< per body: Σ x × x̄ + v × v̄ of what was observed
  std::size_t cotangent_bytes_ = 0;
  std::size_t expected_ = 0;  ///< substeps
  std::size_t peak_ = 0;      ///< with what the tape keeps beside the states [bytes]
  Gradient out_;
};

/// Calls `use` with a run of the scene.
template <class S, class Use>
void with_run(const Scene& scene, const std::shared_ptr<Arena>& arena, const Observer& observer,
              const GradientOptions& options, const Interrupter& interrupter, const Use& use) {
  check_scene(scene);
  check_adjoints(scene);
  arena->execute([&] {
    if (is_renewed(scene.bodies.front())) {  // and so are the others (check_adjoints, check_scene)
      Run<S, RenewedTape<S>> run(scene, arena, observer, options, interrupter);
      use(run);
    } else if (all_of_particles(scene)) {
      Run<S, UpdatedTape<S>> run(scene, arena, observer, options, interrupter);
      use(run);
    } else {
      Run<S, TotalTape<S>> run(scene, arena, observer, options, interrupter);
      use(run);
    }
  });
}

}  // namespace

template <class S>
RollOut roll_out(const Scene& scene, const std::shared_ptr<Arena>& arena, const Observer& observer,
                 const GradientOptions& options, const Interrupter& interrupter) {
  RollOut out;
  with_run<S>(scene, arena, observer, options, interrupter,
              [&](auto& run) { out = run.roll_out(); });
  return out;
}

template <class S>
Gradient gradient(const Scene& scene, const std::shared_ptr<Arena>& arena, const Observer& observer,
                  const GradientOptions& options, const Interrupter& interrupter) {
  Gradient out;
  with_run<S>(scene, arena, observer, options, interrupter,
              [&](auto& run) { out = run.gradient(); });
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
