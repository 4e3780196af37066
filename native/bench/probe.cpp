// SPDX-License-Identifier: GPL-3.0-or-later
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bench/probe.cpp"
#include "bench/probe.hpp"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace matterfit::bench {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Twelve independent chains: latency 4 times two ports, with room. Returns flops done; the sum
/// through `sink` keeps the compiler from dropping them.
double multiply_add(long rounds, float* sink) {
  const hn::ScalableTag<float> d;
  const auto a = hn::Set(d, 0.999999F);
  const auto b = hn::Set(d, 1e-6F);
  auto c0 = hn::Set(d, 1.0F), c1 = hn::Set(d, 1.1F), c2 = hn::Set(d, 1.2F), c3 = hn::Set(d, 1.3F);
  auto c4 = hn::Set(d, 1.4F), c5 = hn::Set(d, 1.5F), c6 = hn::Set(d, 1.6F), c7 = hn::Set(d, 1.7F);
  auto c8 = hn::Set(d, 1.8F), c9 = hn::Set(d, 1.9F), cA = hn::Set(d, 2.0F), cB = hn::Set(d, 2.1F);
  for (long i = 0; i < rounds; ++i) {
    c0 = hn::MulAdd(c0, a, b);
    c1 = hn::MulAdd(c1, a, b);
    c2 = hn::MulAdd(c2, a, b);
    c3 = hn::MulAdd(c3, a, b);
    c4 = hn::MulAdd(c4, a, b);
    c5 = hn::MulAdd(c5, a, b);
    c6 = hn::MulAdd(c6, a, b);
    c7 = hn::MulAdd(c7, a, b);
    c8 = hn::MulAdd(c8, a, b);
    c9 = hn::MulAdd(c9, a, b);
    cA = hn::MulAdd(cA, a, b);
    cB = hn::MulAdd(cB, a, b);
  }
  const auto low = hn::Add(hn::Add(hn::Add(c0, c1), hn::Add(c2, c3)), hn::Add(c4, c5));
  const auto high = hn::Add(hn::Add(hn::Add(c6, c7), hn::Add(c8, c9)), hn::Add(cA, cB));
  *sink = hn::GetLane(hn::SumOfLanes(d, hn::Add(low, high)));
  return static_cast<double>(rounds) * 12.0 * 2.0 * static_cast<double>(hn::Lanes(d));
}

const char* target_name() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace matterfit::bench
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <numeric>
#include <thread>
#include <vector>

namespace matterfit::bench {

HWY_EXPORT(multiply_add);
HWY_EXPORT(target_name);

double peak_fma_gflops(int threads) {
  const auto count = static_cast<std::size_t>(std::max(threads, 1));
  std::vector<double> rates(count);
  std::vector<float> sinks(count);
  const auto work = [&](std::size_t t) {
    using Clock = std::chrono::steady_clock;
    double flops = 0.0;
    const auto start = Clock::now();
    double seconds = 0.0;
    while (seconds < 0.1) {
      flops += HWY_DYNAMIC_DISPATCH(multiply_add)(200000, &sinks[t]);
      seconds = std::chrono::duration<double>(Clock::now() - start).count();
    }
    rates[t] = flops / seconds * 1e-9;
  };
  std::vector<std::thread> others;
  for (std::size_t t = 1; t < count; ++t) others.emplace_back(work, t);
  work(0);
  for (std::thread& other : others) other.join();
  volatile float keep = std::accumulate(sinks.begin(), sinks.end(), 0.0F);
  static_cast<void>(keep);
  return std::accumulate(rates.begin(), rates.end(), 0.0);
}

std::string probe_target() { return HWY_DYNAMIC_DISPATCH(target_name)(); }

}  // namespace matterfit::bench
#endif
