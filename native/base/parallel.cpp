// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/parallel.hpp"

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
}

Arena::~Arena() = default;

}  // namespace matterfit
