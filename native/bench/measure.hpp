// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "bench/probe.hpp"

namespace matterfit::bench {

inline constexpr double kProbeMayMove = 0.10;

struct Measurement {
  double mps = 0.0;           ///< million particle-steps per second, median
  double probe_gflops = 0.0;  ///< median of the probes around the runs kept
  int dropped = 0;
};

inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

/// Results of `run` between two probes that agree, `repetitions` of them. Calls kept(result, mean
/// of the probes); returns how many were dropped. A first run, for memory and threads, is not kept.
template <class Run, class Kept>
int repeat(const Run& run, int threads, int repetitions, const Kept& kept) {
  int dropped = 0;
  run();
  for (int done = 0; done < repetitions;) {
    const double before = peak_fma_gflops(threads);
    const auto result = run();
    const double after = peak_fma_gflops(threads);
    const bool moved = std::abs(after - before) > kProbeMayMove * std::max(before, after);
    if (moved && dropped < 4 * repetitions) {
      ++dropped;
      continue;
    }
    kept(result, 0.5 * (before + after));
    ++done;
  }
  return dropped;
}

/// `run` advances the simulation a while and returns (particle-steps, seconds).
inline Measurement measure(const std::function<std::pair<double, double>()>& run, int threads,
                           int repetitions) {
  std::vector<double> rates;
  std::vector<double> probes;
  Measurement result;
  result.dropped = repeat(run, threads, repetitions, [&](const auto& steps_seconds, double probe) {
    rates.push_back(steps_seconds.first / steps_seconds.second * 1e-6);
    probes.push_back(probe);
  });
  result.mps = median(rates);
  result.probe_gflops = median(probes);
  return result;
}

}  // namespace matterfit::bench
