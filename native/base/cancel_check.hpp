// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/interrupter.hpp"

namespace matterfit {

/// Throws Error(kCancelled) if that was asked of `interrupter`, where there is one.
inline void check_cancel(const Interrupter* interrupter) {
  if (interrupter != nullptr) interrupter->check();
}

/// Looks at an interrupter now and then, cheap enough for inner loops and comparisons. Called at
/// every step of a loop whose steps take microseconds at most it throws Error(kCancelled) soon.
class CancelCheck {
 public:
  /// Without an interrupter nothing is ever cancelled.
  explicit CancelCheck(const Interrupter* interrupter) : interrupter_(interrupter) {}
  CancelCheck(const CancelCheck&) = delete;
  CancelCheck& operator=(const CancelCheck&) = delete;
  void operator()() {
    if ((++calls_ & 0x3fffU) == 0) check_cancel(interrupter_);
  }

 private:
  const Interrupter* interrupter_;
  std::uint32_t calls_ = 0;
};

}  // namespace matterfit
