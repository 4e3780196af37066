// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/interrupter.hpp"

#include "base/error.hpp"

namespace matterfit {

void Interrupter::check() const {
  if (cancelled()) throw Error(ErrorKind::kCancelled, "Cancelled.");
}

void Interrupter::report(const Progress& progress) {
  const std::lock_guard lock(mutex_);
  progress_ = progress;
}

Progress Interrupter::progress() const {
  const std::lock_guard lock(mutex_);
  return progress_;
}

}  // namespace matterfit
