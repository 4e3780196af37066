// SPDX-License-Identifier: GPL-3.0-or-later
// Speed of the neural laws alone, without the solver: the published form with both GELUs and the
// isotropic law, forward and forward with backward. One JSON object a line on standard output, a
// table on standard error. «share» is the rate of multiplications and additions in the nets'
// matrices by the probe's.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "base/random.hpp"
#include "bench/bench_main.hpp"
#include "bench/measure.hpp"
#include "material/neural/isotropic_law.hpp"
#include "material/neural/net_training.hpp"
#include "material/neural/published_law.hpp"

namespace matterfit::bench {
namespace {

using Clock = std::chrono::steady_clock;
using material::GeluMode;
using material::kNetWeights;

constexpr double kDt = 1e-4;
/// Multiplications and additions in the matrices of both nets; backward they are done thrice, the
/// forward pass again among them.
constexpr double kFlopsForward = 2.0 * 2.0 * static_cast<double>(kNetWeights);

/// Deformed points with cotangents, for all laws.
struct PointSet {
  explicit PointSet(std::size_t n)
      : count(n),
        trial(9 * n),
        strain(n, 0.0F),
        elastic(9 * n),
        after(n),
        tau(9 * n),
        bar(9 * n),
        strain_bar(n) {
    Random random(1);
    for (std::size_t i = 0; i < trial.size(); ++i) {
      trial[i] = static_cast<float>((i % 9 % 4 == 0 ? 1.0 : 0.0) + random.between(-0.1, 0.1));
      bar[i] = static_cast<float>(random.between(-1.0, 1.0));
    }
  }
  std::size_t count;
  std::vector<float> trial, strain, elastic, after, tau, bar, strain_bar;
  std::vector<float> trial_bar = std::vector<float>(trial.size());
};

/// Of one law.
struct Work {
  std::string name;
  std::function<void()> forward;
  std::function<void()> backward;
  double flops = 0.0;  ///< of the matrices, forward, a point
};

/// Rate of `work`, repeated for `seconds`.
Measurement rate(const std::function<void()>& work, std::size_t points, int threads, double seconds,
                 int repetitions) {
  return measure(
      [&] {
        const auto begin = Clock::now();
        double spent = 0.0;
        double done = 0.0;
        while (spent < seconds) {
          work();
          done += static_cast<double>(points);
          spent = std::chrono::duration<double>(Clock::now() - begin).count();
        }
        return std::pair{done, spent};
      },
      threads, repetitions);
}

void report(const Work& work, PointSet& points, int threads, double seconds, int repetitions) {
  const Measurement forward = rate(work.forward, points.count, threads, seconds, repetitions);
  const Measurement both = rate(
      [&] {
        work.forward();
        work.backward();
      },
      points.count, threads, seconds, repetitions);
  const double share = forward.mps * work.flops * 1e-3 / forward.probe_gflops;
  const double share_both = both.mps * 4.0 * work.flops * 1e-3 / both.probe_gflops;
  std::fprintf(stderr, "%-22s %9zu %7d | %8.2f %6.2f | %8.2f %6.2f | %7.1f\n", work.name.c_str(),
               points.count, threads, forward.mps, share, both.mps, share_both,
               forward.probe_gflops);
  std::printf(
      "{\"name\": \"neural\", \"law\": \"%s\", \"threads\": %d, \"points\": %zu, \"forward_mps\": "
      "%.3f, \"forward_share\": %.3f, \"forward_backward_mps\": %.3f, \"forward_backward_share\": "
      "%.3f, \"probe_gflops\": %.1f, \"dropped\": %d}\n",
      work.name.c_str(), threads, points.count, forward.mps, share, both.mps, share_both,
      forward.probe_gflops, forward.dropped + both.dropped);
  std::fflush(stdout);
}

std::vector<Work> all_works(PointSet& p, Arena& arena, std::vector<double>& weights_bar) {
  const material::PublishedWeights weights{material::random_net(1), material::random_net(2)};
  const auto published = [&p, &arena, &weights_bar, weights](const char* name, GeluMode mode) {
    return Work{name,
                [&p, &arena, weights, mode] {
                  material::published_forward<float>(weights, mode, p.trial, p.elastic, p.tau,
                                                     arena);
                },
                [&p, &arena, &weights_bar, weights, mode] {
                  material::published_backward<float>(weights, mode, p.trial, p.bar, p.bar,
                                                      p.trial_bar, weights_bar, arena);
                },
                kFlopsForward};
  };
  material::IsotropicWeights isotropic = material::plain_isotropic(4e4, 9e4);
  isotropic[material::kYieldWeight] = std::log(0.03);
  const std::size_t stresses = 6 * p.count;
  Work ours{"isotropic",
            [&p, &arena, isotropic, stresses] {
              material::isotropic_forward<float>(
                  isotropic, kDt, {p.trial, p.strain},
                  {p.elastic, p.after, std::span(p.tau).first(stresses)}, arena);
            },
            [&p, &arena, isotropic, stresses] {
              material::IsotropicWeights bar{};
              material::isotropic_backward<float>(
                  isotropic, kDt, {p.trial, p.strain},
                  {p.bar, p.strain, std::span<const float>(p.bar).first(stresses)}, p.trial_bar,
                  p.strain_bar, bar, arena);
            },
            0.0};
  return {published("published, polynomial", GeluMode::kPolynomial),
          published("published, exact", GeluMode::kExact), std::move(ours)};
}

int run(int argc, char** argv) {
  std::vector<std::size_t> sizes{1'000, 100'000};
  std::vector<int> thread_counts{1, 2};
  double seconds = 0.3;
  int repetitions = 5;
  CLI::App app("Speed of neural laws in million points a second");
  app.add_option("--points", sizes)->capture_default_str();
  app.add_option("--threads", thread_counts)->capture_default_str();
  app.add_option("--seconds", seconds, "of one measurement, at least")->capture_default_str();
  app.add_option("--repetitions", repetitions)->capture_default_str()->check(CLI::Range(1, 99));
  CLI11_PARSE(app, argc, argv);

  std::fprintf(stderr, "probe: %s, %.1f GFLOP/s on one thread\n", probe_target().c_str(),
               peak_fma_gflops(1));
  std::fprintf(stderr, "%-22s %9s %7s | %8s %6s | %8s %6s | %7s\n", "law", "points", "threads",
               "forward", "share", "and back", "share", "probe");
  std::vector<double> weights_bar(2 * kNetWeights);
  for (const std::size_t size : sizes) {
    PointSet points(size);
    for (const int threads : thread_counts) {
      Arena arena(threads);
      for (const Work& work : all_works(points, arena, weights_bar)) {
        report(work, points, threads, seconds, repetitions);
      }
    }
  }
  return 0;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  return matterfit::bench::bench_main("neural_bench", matterfit::bench::run, argc, argv);
}
