// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

#include "base/parallel.hpp"

namespace matterfit {

/// Work on one of several tasks that know nothing of each other, with an arena of its own thread.
using SideTask = std::function<void(std::size_t task, const std::shared_ptr<Arena>& arena)>;

/// Runs `work` for each of `count` tasks, at most `at_once` of them side by side (this thread among
/// them) on `threads` threads in all: where there are fewer tasks than threads, the threads that
/// are left over help in the arenas. Which thread takes which task is open. The first exception
/// ends the others before their next task and is thrown again. Threads that cannot be started leave
/// their tasks to the others.
void side_by_side(std::size_t count, std::size_t at_once, int threads, const SideTask& work);

}  // namespace matterfit
