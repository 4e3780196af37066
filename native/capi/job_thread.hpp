// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "base/interrupter.hpp"
#include "job/documents/document.hpp"
#include "job/run_job.hpp"

namespace matterfit::capi {

/// How a job ended, and what it says.
struct Outcome {
  int exit_status = 0;  ///< of the tool: 0, 2, 3 or 130
  std::string result;   ///< JSON
  std::string error;    ///< empty unless it failed
};

/// Runs a job on the calling thread; nothing is thrown.
[[nodiscard]] Outcome run_to_end(const job::Job& job, const job::RunOptions& options,
                                 Interrupter& interrupter) noexcept;

/// A job on a thread of its own.
class JobThread {
 public:
  JobThread(job::Job job, job::RunOptions options);
  /// Any other work that looks at the interrupter; what it throws becomes the outcome.
  explicit JobThread(std::function<Outcome(Interrupter&)> work);
  ~JobThread();
  JobThread(const JobThread&) = delete;
  JobThread& operator=(const JobThread&) = delete;

  void cancel() { interrupter_.cancel(); }
  /// True once it has ended; waits at most `seconds` (negative: for ever).
  bool wait(double seconds);
  [[nodiscard]] bool ended() const;
  [[nodiscard]] Progress progress() const { return interrupter_.progress(); }
  [[nodiscard]] double seconds() const;
  /// A guess from the fraction done since the start; negative: not known yet.
  [[nodiscard]] double seconds_left() const;
  /// Only once it has ended.
  [[nodiscard]] const Outcome& outcome() const { return outcome_; }

 private:
  using Clock = std::chrono::steady_clock;
  std::function<Outcome(Interrupter&)> work_;
  Interrupter interrupter_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point end_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool ended_ = false;
  mutable double first_fraction_ = 0.0;  ///< that progress() was seen at, and when
  mutable Clock::time_point first_seen_;
  Outcome outcome_;
  std::thread thread_;
};

/// Resident memory of this process [bytes]; 0 where it cannot be told.
[[nodiscard]] std::uint64_t resident_bytes();

}  // namespace matterfit::capi
