// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <map>
#include <utility>

namespace matterfit::mpm {

/// What the states of a run need at least, however it is divided into segments, with `other` bytes
/// besides.
[[nodiscard]] std::size_t least_record(std::size_t substeps, std::size_t state_bytes,
                                       std::size_t other, std::size_t first_interval = 1);
/// Throws Error(kInput): the budget does not hold that.
[[noreturn]] void throw_over_budget(std::size_t budget, std::size_t substeps,
                                    std::size_t state_bytes, std::size_t other,
                                    std::size_t first_interval = 1);

/// States of a run of unknown length inside a memory budget: that before every `interval`-th
/// substep. The interval begins at 1, or another power of two, and doubles whenever the budget is
/// full, so it ends at the smallest power of two for which both the states at the ends of segments
/// and those inside one, when it is run again, fit; in the end about √T of each, if need be
/// (Griewank and Walther, Evaluating Derivatives, §12: two-level checkpointing).
template <class State>
class GradientRecord {
 public:
  explicit GradientRecord(std::size_t budget, std::size_t first_interval = 1)
      : budget_(budget), first_interval_(first_interval), interval_(first_interval) {}

  [[nodiscard]] std::size_t interval() const { return interval_; }
  [[nodiscard]] bool wants(std::size_t substep) const { return substep % interval_ == 0; }

  /// What else the budget has to hold [bytes], for a run of about `expected` substeps.
  void set_other(std::size_t bytes, std::size_t expected) {
    other_ = bytes;
    shrink(expected);
  }
  /// The state before a substep that it wants; `bytes` of what is kept of a substep, here or inside
  /// a segment that is run again.
  void put(std::size_t substep, State state, std::size_t bytes, std::size_t expected) {
    largest_ = std::max(largest_, bytes);
    kept_ += bytes;
    states_.insert_or_assign(substep, std::pair(std::move(state), bytes));
    shrink(expected);
  }
  /// Throws now what a run of so many substeps would throw later.
  void require(std::size_t substeps) const {
    if (least_record(substeps, largest_, other_, first_interval_) > budget_) {
      throw_over_budget(budget_, substeps, largest_, other_, first_interval_);
    }
  }
  /// Forgets substeps from `substep` on: they are to be taken again.
  void drop_from(std::size_t substep) {
    while (!states_.empty() && states_.rbegin()->first >= substep) drop(std::prev(states_.end()));
  }
  /// The state before the last segment, with its first substep.
  [[nodiscard]] std::pair<std::size_t, State> take_last() {
    const auto last = std::prev(states_.end());
    std::pair<std::size_t, State> out(last->first, std::move(last->second.first));
    drop(last);
    return out;
  }
  [[nodiscard]] bool empty() const { return states_.empty(); }
  [[nodiscard]] std::size_t largest() const { return largest_; }
  [[nodiscard]] std::size_t peak() const { return peak_; }
  [[nodiscard]] std::size_t other() const { return other_; }
  /// Now, without what a segment takes when it is run again [bytes].
  [[nodiscard]] std::size_t held() const { return other_ + kept_; }
  /// Whether segments will be run again, so that the budget has to hold the states inside one.
  void reserve_segment(bool reserve) { reserve_ = reserve; }

 private:
  using States = std::map<std::size_t, std::pair<State, std::size_t>>;

  /// With the states inside a segment, less the one that begins it.
  [[nodiscard]] std::size_t needed() const {
    return held() + (reserve_ ? (interval_ - 1) * largest_ : 0);
  }
  void drop(typename States::iterator at) {
    kept_ -= at->second.second;
    states_.erase(at);
  }
  void shrink(std::size_t expected) {
    while (needed() > budget_) {
      std::size_t stay = 0;
      for (const auto& [substep, state] : states_) {
        if (substep % (2 * interval_) == 0) stay += state.second;
      }
      // Longer segments may need more than the states that they save.
      if (stay + interval_ * largest_ >= kept_) {
        throw_over_budget(budget_, std::max(expected, interval_ * states_.size()), largest_, other_,
                          first_interval_);
      }
      interval_ *= 2;
      for (auto at = states_.begin(); at != states_.end();) {
        const auto next = std::next(at);
        if (!wants(at->first)) drop(at);
        at = next;
      }
    }
    peak_ = std::max(peak_, needed());
  }

  std::size_t budget_;
  std::size_t first_interval_;
  std::size_t interval_;
  bool reserve_ = true;
  std::size_t other_ = 0;
  std::size_t kept_ = 0;
  std::size_t largest_ = 0;
  std::size_t peak_ = 0;
  States states_;
};

}  // namespace matterfit::mpm
