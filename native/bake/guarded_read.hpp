// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

namespace matterfit::bake {

struct GuardLimits {
  double seconds = 60.0;                           ///< wall clock
  std::uint64_t memory = std::uint64_t{4} << 30U;  ///< beyond what this process maps [bytes]
};

/// Runs `work` in a forked child with limits of time and memory, so that a library that hangs,
/// aborts or eats memory on a hostile file takes nothing with it. `work` returns what is wrong, or
/// the empty string; an exception's text counts as such. Returns nothing if all is well, else what
/// is wrong: what `work` said, or that it ended by a signal, ran out of time or of memory.
///
/// Caveat: after fork() a process with several threads may strictly do async-signal-safe work only.
/// glibc keeps its allocator usable in the child; another library's lock that some thread held at
/// that moment stays locked for good, in which case the child runs into the time limit and a good
/// file is reported as one that could not be read in time. So `work` must not start threads or
/// parallel loops, and should do nothing but read. Files that our own manifest lists need none of
/// this: their size and hash suffice.
[[nodiscard]] std::optional<std::string> run_guarded(const std::function<std::string()>& work,
                                                     const GuardLimits& limits = {});

}  // namespace matterfit::bake
