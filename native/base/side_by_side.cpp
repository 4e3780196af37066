// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/side_by_side.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace matterfit {

void side_by_side(std::size_t count, std::size_t at_once, int threads, const SideTask& work) {
  const std::size_t workers =
      std::min({count, std::max<std::size_t>(1, at_once), std::size_t(std::max(1, threads))});
  if (workers == 0) return;
  const int each = std::max(1, threads / static_cast<int>(workers));
  std::atomic<std::size_t> next{0};
  std::atomic<bool> stop{false};
  std::exception_ptr thrown;
  std::mutex mutex;
  const auto take = [&] {
    try {
      const auto arena = std::make_shared<Arena>(each);
      for (std::size_t i = next++; i < count && !stop; i = next++) work(i, arena);
    } catch (...) {
      stop = true;
      const std::lock_guard lock(mutex);
      if (!thrown) thrown = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> others;
    others.reserve(workers);
    try {
      for (std::size_t k = 1; k < workers; ++k) others.emplace_back(take);
    } catch (const std::system_error&) {  // the threads that there are do it all
    }
    take();
  }
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace matterfit
