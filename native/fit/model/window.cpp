// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/window.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace matterfit::fit {
namespace {

constexpr std::size_t kFirstWindow = 6;  // samples in time
/// A window that the next one extends by less than this is left out.
constexpr double kWorthwhile = 0.75;

/// Times of one run at which some sample is used, ascending.
std::vector<double> used_times(const Run& run) {
  std::set<double> times;
  for (const Capture& capture : run.captures) {
    for (const std::size_t t : capture.used_frames()) times.insert(capture.input.tracks.times[t]);
  }
  return {times.begin(), times.end()};
}

}  // namespace

Window first_window(const std::vector<Run>& runs, std::size_t samples) {
  Window window;
  bool named = false;
  for (const Run& run : runs) {
    const std::vector<double> times = used_times(run);
    if (times.empty()) {
      window.until.push_back(-1.0);
      continue;
    }
    const double until = times[std::min(samples, times.size()) - 1];
    window.until.push_back(until);
    if (named) continue;
    named = true;
    const Clock& clock = run.clock;
    window.first_frame = clock.first_frame + int(std::floor(times.front() * clock.fps + 1e-6));
    window.last_frame = clock.first_frame + int(std::ceil(until * clock.fps - 1e-6));
  }
  return window;
}

std::vector<Window> growing_windows(const std::vector<Run>& runs, bool grow) {
  std::size_t longest = 0;
  for (const Run& run : runs) longest = std::max(longest, used_times(run).size());
  std::vector<Window> windows;
  if (grow) {
    for (std::size_t samples = kFirstWindow; double(samples) < kWorthwhile * double(longest);
         samples *= 2) {
      windows.push_back(first_window(runs, samples));
    }
  }
  windows.push_back(first_window(runs, longest));
  return windows;
}

}  // namespace matterfit::fit
