// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/parallel.hpp"

#include <tbb/task_scheduler_observer.h>
#include <xmmintrin.h>

#include <string>
#include <thread>

#include "base/error.hpp"

namespace matterfit {
namespace {
constexpr unsigned kFlushToZero = 0x8000U;
constexpr unsigned kDenormalsAreZero = 0x0040U;
}  // namespace

FlushDenormals::FlushDenormals() noexcept : saved_(_mm_getcsr()) {
  _mm_setcsr(saved_ | kFlushToZero | kDenormalsAreZero);
}
FlushDenormals::~FlushDenormals() { _mm_setcsr(saved_); }

/// Worker threads may serve other arenas later, so the mode is undone when they leave.
class Arena::Observer : public tbb::task_scheduler_observer {
 public:
  explicit Observer(tbb::task_arena& arena) : tbb::task_scheduler_observer(arena) { observe(true); }
  ~Observer() override { observe(false); }
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;
  void on_scheduler_entry(bool is_worker) override {
    if (is_worker) _mm_setcsr(_mm_getcsr() | kFlushToZero | kDenormalsAreZero);
  }
  void on_scheduler_exit(bool is_worker) override {
    if (is_worker) _mm_setcsr(_mm_getcsr() & ~(kFlushToZero | kDenormalsAreZero));
  }
};

Arena::Arena(int threads) : threads_(threads) {
  if (threads < 0 || threads > 1024) {
    throw_input("threads: " + std::to_string(threads) + " is outside [0, 1024]; 0 uses all cores.");
  }
  if (threads_ == 0) {
    threads_ = static_cast<int>(std::thread::hardware_concurrency());
    if (threads_ < 1) threads_ = 1;
  }
  arena_ = std::make_unique<tbb::task_arena>(threads_);
  // An arena imposes on every task the floating-point mode that it found here.
  const FlushDenormals flush;
  arena_->initialize();
  observer_ = std::make_unique<Observer>(*arena_);
}

Arena::~Arena() = default;

}  // namespace matterfit
