// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <vector>

namespace matterfit {

/// Where a long computation stands. `fraction` is in [0, 1]; `frame` is a scene frame number.
struct Progress {
  double fraction = 0.0;
  int frame = 0;
  int last_frame = 0;
  /// What is being done, in words of the panel ("Simulating", "Baking volume").
  std::string label;
  /// The same in fewer words, each with less than the last, for those that have little room.
  std::vector<std::string> shorter = {};
};

/// Cancellation and progress of one job, shared by the thread that computes and those that watch.
/// All members are safe to call from any thread.
class Interrupter {
 public:
  void cancel() noexcept { cancelled_.store(true, std::memory_order_relaxed); }
  [[nodiscard]] bool cancelled() const noexcept {
    return cancelled_.load(std::memory_order_relaxed);
  }
  /// Throws Error(kCancelled) if cancel() was called. Call at least every 0.2 s of work.
  void check() const;
  void report(const Progress& progress);
  [[nodiscard]] Progress progress() const;

 private:
  std::atomic<bool> cancelled_{false};
  mutable std::mutex mutex_;
  Progress progress_;
};

}  // namespace matterfit
