// SPDX-License-Identifier: GPL-3.0-or-later
// What a gradient keeps of a run of bodies of one formulation, and how it goes back over it.
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "mpm/gradient.hpp"
#include "mpm/renewed_adjoint.hpp"
#include "mpm/stepper.hpp"
#include "mpm/total_group_adjoint.hpp"
#include "mpm/updated_adjoint.hpp"

namespace matterfit::mpm {

/// Takes the substep again that is given, from the state before it.
using StepAgain = std::function<void(std::size_t substep)>;
/// Called with each substep, last first, once it has been gone back over.
using SubstepPassed = std::function<void(std::size_t substep)>;

/// The tape of total Lagrangian bodies: a state is what its substep goes back by.
template <class S>
class TotalTape {
 public:
  using State = std::vector<TotalMemberState<S>>;  ///< before a substep
  static constexpr std::size_t kFirstInterval = 1;

  TotalTape(Stepper<S>& stepper, const GradientOptions& options)
      : stepper_(stepper), target_(options.simulation.target), rates_(options.of_no_damping) {}

  [[nodiscard]] State state() const { return stepper_.total().record(); }
  /// Size of what is kept of a substep [bytes].
  [[nodiscard]] static std::size_t bytes(const State& state);
  /// Around each substep of the forward pass.
  void before_substep() {}
  void after_substep() { log_.push_back(stepper_.total().last_substeps()); }
  /// Substeps from this one on are to be taken again.
  void forget_from(std::size_t substep) { log_.resize(substep); }
  /// Beside the states [bytes].
  [[nodiscard]] std::size_t log_bytes() const {
    return log_.size() * stepper_.total().size() * sizeof(TotalSubstep);
  }
  /// Size of whole substeps that are kept as long as there is room, and how they are given up.
  [[nodiscard]] static std::size_t spare_bytes() { return 0; }
  void give_up() {}
  [[nodiscard]] static bool has_all() { return false; }

  /// At the end of the forward pass.
  void turn();
  void observe(const FrameLoss& loss) { adjoint_->observe(stepper_.arena(), loss); }
  /// Over the substeps of [begin, end) from the state before the first.
  void back(std::size_t begin, std::size_t end, State first, const StepAgain& again,
            const SubstepPassed& passed);
  /// `observed`, of each body: Σ x × x̄ + v × v̄ of all that was observed.
  void collect(const std::vector<Vec3d>& observed, Gradient& out) const {
    adjoint_->collect(observed, out);
  }

 private:
  [[nodiscard]] static std::vector<ContactMemories> memories(const State& state);

  Stepper<S>& stepper_;
  SimdTarget target_;
  bool rates_;
  std::unique_ptr<TotalGroupAdjoint<S>> adjoint_;
  std::vector<std::vector<TotalSubstep>> log_;  ///< of every substep
  std::vector<ContactMemories> after_;          ///< the next substep to go back over
};

/// The tape of updated Lagrangian bodies: a substep goes back by a record of its own, with which
/// none is run again as long as all records fit; else a few states, and the records of one segment
/// at a time.
template <class S>
class UpdatedTape {
 public:
  using State = std::string;  ///< before a substep, bytes
  static constexpr std::size_t kFirstInterval = 16;

  UpdatedTape(Stepper<S>& stepper, const GradientOptions& options)
      : stepper_(stepper),
        target_(options.simulation.target),
        rates_(options.of_no_damping),
        published_(options.published_weights) {}

  [[nodiscard]] State state() const;
  [[nodiscard]] std::size_t bytes(const State& state) const;
  void before_substep();
  void after_substep();
  void forget_from(std::size_t substep);
  [[nodiscard]] static std::size_t log_bytes() { return 0; }
  [[nodiscard]] std::size_t spare_bytes() const { return record_bytes_; }
  void give_up();
  [[nodiscard]] bool has_all() const { return keeps_; }

  void turn();
  void observe(const FrameLoss& loss);
  void back(std::size_t begin, std::size_t end, State first, const StepAgain& again,
            const SubstepPassed& passed);
  void collect(const std::vector<Vec3d>& observed, Gradient& out) const;

 private:
  Stepper<S>& stepper_;
  SimdTarget target_;
  bool rates_;
  bool published_;  ///< also by the published law's weights
  bool keeps_ = true;
  std::deque<UpdatedRecord<S>> records_;
  std::size_t finished_ = 0;  ///< of them in the forward pass; one more may have been begun
  std::size_t record_bytes_ = 0;
  std::size_t largest_ = 0;              ///< of one record
  mutable std::size_t state_bytes_ = 0;  ///< of the last state
  std::unique_ptr<UpdatedAdjoint<S>> adjoint_;
  UpdatedCotangents<S> bar_;
};

/// The tape of renewed bodies: as that of total Lagrangian ones, whose nodes they share. A substep
/// at whose end the reference is renewed is taken again up to there.
template <class S>
class RenewedTape {
 public:
  using State = RenewedState<S>;  ///< before a substep
  static constexpr std::size_t kFirstInterval = 1;

  RenewedTape(Stepper<S>& stepper, const GradientOptions& options)
      : stepper_(stepper), target_(options.simulation.target), rates_(options.of_no_damping) {}

  [[nodiscard]] State state();
  [[nodiscard]] static std::size_t bytes(const State& state) { return state.bytes(); }
  void before_substep();
  void after_substep();
  void forget_from(std::size_t substep);
  [[nodiscard]] std::size_t log_bytes() const;
  [[nodiscard]] static std::size_t spare_bytes() { return 0; }
  void give_up() {}
  [[nodiscard]] static bool has_all() { return false; }

  void turn();
  void observe(const FrameLoss& loss) { adjoint_->observe(stepper_.arena(), after_, loss, bar_); }
  void back(std::size_t begin, std::size_t end, State first, const StepAgain& again,
            const SubstepPassed& passed);
  void collect(const std::vector<Vec3d>& observed, Gradient& out) const;

 private:
  Stepper<S>& stepper_;
  SimdTarget target_;
  bool rates_;
  std::vector<RenewedSubstep> log_;                  ///< of every substep
  std::size_t touches_ = 0;                          ///< in all of it
  std::shared_ptr<const RenewedReference<S>> last_;  ///< of a state that was recorded
  std::size_t references_ = 0;                       ///< of all such [bytes]
  std::unique_ptr<RenewedAdjoint<S>> adjoint_;
  RenewedCotangents<S> bar_;
  State after_;  ///< the next substep to go back over
};

extern template class TotalTape<float>;
extern template class TotalTape<double>;
extern template class UpdatedTape<float>;
extern template class UpdatedTape<double>;
extern template class RenewedTape<float>;
extern template class RenewedTape<double>;

}  // namespace matterfit::mpm
