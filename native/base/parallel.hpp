// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <cstddef>
#include <memory>
#include <utility>

namespace matterfit {

/// Sets flush-to-zero and denormals-are-zero on the calling thread, restores on destruction.
class FlushDenormals {
 public:
  FlushDenormals() noexcept;
  ~FlushDenormals();
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned saved_;
};

/// The threads of one job: an oneTBB arena of a fixed size whose threads flush denormals.
/// Loops over disjoint outputs, so results never depend on the number of threads; a reduction is
/// written by its caller as per-block partial results combined in block order.
class Arena {
 public:
  /// `threads` = 0: as many as the machine has. Throws Error(kInput) outside [0, 1024].
  explicit Arena(int threads = 0);
  ~Arena();
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;

  [[nodiscard]] int threads() const noexcept { return threads_; }

  /// Runs `work()` inside the arena on the calling thread; parallel_for inside it stays inside.
  template <class Work>
  void execute(Work&& work) {
    arena_->execute([&] {
      const FlushDenormals flush;
      work();
    });
  }

  /// Calls `body(i)` for i in [begin, end), `grain` indices at least to a task.
  template <class Body>
  void parallel_for(std::size_t begin, std::size_t end, std::size_t grain, const Body& body) {
    if (begin >= end) return;
    if (threads_ == 1 || end - begin <= grain) {
      const FlushDenormals flush;
      for (std::size_t i = begin; i < end; ++i) body(i);
      return;
    }
    execute([&] {
      tbb::parallel_for(
          tbb::blocked_range<std::size_t>(begin, end, grain),
          [&](const tbb::blocked_range<std::size_t>& range) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) body(i);
          },
          tbb::auto_partitioner());
    });
  }

 private:
  int threads_;
  std::unique_ptr<tbb::task_arena> arena_;
};

}  // namespace matterfit
