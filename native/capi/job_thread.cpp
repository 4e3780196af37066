// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/job_thread.hpp"

#include <unistd.h>

#include <cstdio>
#include <new>

#include "base/error.hpp"

namespace matterfit::capi {
namespace {

Outcome failure(ErrorKind kind, const std::string& message) {
  Outcome outcome;
  outcome.exit_status = exit_status(kind);
  outcome.error = message;
  const job::Json json = {{"status", kind == ErrorKind::kCancelled ? "cancelled" : "error"},
                          {"error", message},
                          {"exit_status", outcome.exit_status}};
  outcome.result = json.dump(2, ' ', false, job::Json::error_handler_t::replace);
  return outcome;
}

template <class Work>
Outcome guarded(const Work& work) noexcept {
  try {
    try {
      return work();
    } catch (const Error& error) {
      return failure(error.kind(), error.what());
    } catch (const std::bad_alloc&) {
      return failure(ErrorKind::kCompute,
                     "out of memory. Use a larger particle separation, fewer frames of fewer "
                     "outputs, or a machine with more memory.");
    } catch (const std::exception& error) {
      return failure(ErrorKind::kCompute, std::string("internal error: ") + error.what());
    }
  } catch (...) {
    Outcome outcome;
    outcome.exit_status = exit_status(ErrorKind::kCompute);
    return outcome;
  }
}

}  // namespace

Outcome run_to_end(const job::Job& job, const job::RunOptions& options,
                   Interrupter& interrupter) noexcept {
  return guarded([&] {
    Outcome outcome;
    const job::Json result = job::run_job(job, options, interrupter);
    outcome.result = result.dump(2, ' ', false, job::Json::error_handler_t::replace);
    // A fit that was cancelled has a result all the same: the best so far.
    if (result.value("status", "") == "cancelled") {
      outcome.exit_status = exit_status(ErrorKind::kCancelled);
      outcome.error = result.value("error", "");
    }
    return outcome;
  });
}

JobThread::JobThread(job::Job job, job::RunOptions options)
    : JobThread([job = std::move(job), options](Interrupter& interrupter) {
        return run_to_end(job, options, interrupter);
      }) {}

JobThread::JobThread(std::function<Outcome(Interrupter&)> work) : work_(std::move(work)) {
  thread_ = std::thread([this] {
    Outcome outcome = guarded([this] { return work_(interrupter_); });
    const std::lock_guard lock(mutex_);
    outcome_ = std::move(outcome);
    end_ = Clock::now();
    ended_ = true;
    changed_.notify_all();
  });
}

JobThread::~JobThread() {
  cancel();
  thread_.join();
}

bool JobThread::wait(double seconds) {
  std::unique_lock lock(mutex_);
  const auto done = [this] { return ended_; };
  if (seconds < 0.0) {
    changed_.wait(lock, done);
    return true;
  }
  constexpr double kLongest = 1e9;
  return changed_.wait_for(lock, std::chrono::duration<double>(std::min(seconds, kLongest)), done);
}

bool JobThread::ended() const {
  const std::lock_guard lock(mutex_);
  return ended_;
}

double JobThread::seconds() const {
  const std::lock_guard lock(mutex_);
  return std::chrono::duration<double>((ended_ ? end_ : Clock::now()) - start_).count();
}

double JobThread::seconds_left() const {
  if (ended()) return 0.0;
  const double fraction = progress().fraction;
  const std::lock_guard lock(mutex_);
  const auto now = Clock::now();
  // From the first frame that is computed: a resumed job starts far along.
  if (!(first_fraction_ > 0.0) && fraction > 0.0) {
    first_fraction_ = fraction;
    first_seen_ = now;
  }
  constexpr double kTooEarly = 0.01;
  const double done = fraction - first_fraction_;
  if (!(first_fraction_ > 0.0) || done < kTooEarly) return -1.0;
  return std::chrono::duration<double>(now - first_seen_).count() * (1.0 - fraction) / done;
}

std::uint64_t resident_bytes() {
  std::FILE* file = std::fopen("/proc/self/statm", "re");
  if (file == nullptr) return 0;
  unsigned long total = 0;
  unsigned long resident = 0;
  const int read = std::fscanf(file, "%lu %lu", &total, &resident);
  std::fclose(file);
  return read == 2 ? std::uint64_t{resident} * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE))
                   : 0;
}

}  // namespace matterfit::capi
