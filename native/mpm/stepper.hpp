// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "mpm/body_contact.hpp"
#include "mpm/renewed_group.hpp"
#include "mpm/schedule.hpp"
#include "mpm/simulation.hpp"
#include "mpm/total_group.hpp"
#include "mpm/updated_group.hpp"

namespace matterfit::mpm {

/// Called around the substeps of a frame. A frame that failed begins again from 0, with more.
struct SubstepHooks {
  std::function<void(int substep, int substeps)> before;
  std::function<void()> after;
};

/// All bodies of a scene and their clock: what Simulation runs, and Gradient records and runs
/// again. Errors as Simulation's. Call everything but the constructor inside `arena`.
/// S other than float: one total Lagrangian body, or updated ones.
template <class S>
class Stepper {
 public:
  Stepper(Scene scene, std::shared_ptr<Arena> arena, const Simulation::Options& options);
  Stepper(const Stepper&) = delete;
  Stepper& operator=(const Stepper&) = delete;

  /// With the walls among the colliders, after the scene's own.
  [[nodiscard]] const Scene& scene() const { return scene_; }
  [[nodiscard]] Arena& arena() { return *arena_; }
  [[nodiscard]] TotalGroup<S>& total() { return *total_; }
  /// Null where no body is of that formulation.
  [[nodiscard]] UpdatedGroup<S>* updated() { return updated_.get(); }
  [[nodiscard]] RenewedGroup<S>* renewed() { return renewed_.get(); }
  /// Indices of the updated bodies into scene().bodies.
  [[nodiscard]] const std::vector<std::size_t>& updated_bodies() const { return updated_bodies_; }
  [[nodiscard]] const std::vector<std::size_t>& renewed_bodies() const { return renewed_bodies_; }
  /// From here on each substep of the updated bodies fills it; null: none.
  void keep(UpdatedRecord<S>* record) { record_ = record; }
  /// The frame the state stands at.
  [[nodiscard]] int frame() const { return frame_; }

  /// Frames that a schedule has are stepped by it.
  void set_schedule(Schedule schedule);
  /// One frame. `seconds` of the report is left out.
  FrameReport advance(const Interrupter& interrupter, const SubstepHooks& hooks = {});
  /// How the last frame was stepped.
  [[nodiscard]] const FrameSchedule& taken() const { return taken_; }
  [[nodiscard]] SubstepCost measure(double seconds, const Interrupter& interrupter);

  /// Simulation::change.
  void change(std::size_t body, const RigidChange& change) { total_->change(body, change); }

  /// Substep k of a frame as advance() takes it, alone, from the state before it.
  void substep(int frame, const FrameSchedule& plan, int k);

  [[nodiscard]] FrameState state() const;
  /// The same without rounding.
  [[nodiscard]] ObservedFrame observe(bool deformation_gradients) const;
  [[nodiscard]] std::string save() const;
  void load(const std::string& bytes);

 private:
  static constexpr std::uint32_t kNoBody = 0xffffffffU;

  void add_walls();
  void build_groups();
  /// The state at `before`, with the body in the updated formulation. False if it cannot be.
  [[nodiscard]] bool hand_over(const std::string& before, std::size_t body);
  void check_start() const;
  void check_walls(const FrameState& state) const;
  /// Those that are not total Lagrangian, all of one formulation; or null.
  [[nodiscard]] ParticleBodies<S>* particle_bodies() const {
    if (renewed_) return renewed_.get();
    return updated_.get();
  }
  [[nodiscard]] double time_of(int at) const { return (at - scene_.first_frame) / scene_.fps; }
  [[nodiscard]] StepLimit choose_step(double time, const Interrupter& interrupter);
  [[nodiscard]] double substeps(const StepLimit& step) const;
  [[nodiscard]] int fixed_substeps() const;
  void begin_frame(int substeps, const std::optional<std::vector<double>>& renewals);
  void step(double time, double dt, FrameReport& report);

  Scene scene_;
  std::shared_ptr<Arena> arena_;
  Simulation::Options options_;
  std::uint32_t handed_ = kNoBody;  ///< the body that was handed over
  std::unique_ptr<TotalGroup<S>> total_;
  std::unique_ptr<UpdatedGroup<S>> updated_;
  std::unique_ptr<RenewedGroup<S>> renewed_;
  UpdatedRecord<S>* record_ = nullptr;
  std::vector<std::size_t> updated_bodies_;
  std::vector<std::size_t> renewed_bodies_;
  std::unique_ptr<BodyContacts> body_contacts_;  ///< null where S is not float
  Schedule schedule_;
  FrameSchedule taken_;
  int frame_ = 0;
};

extern template class Stepper<float>;
extern template class Stepper<double>;

}  // namespace matterfit::mpm
