// SPDX-License-Identifier: GPL-3.0-or-later
// Speed of the neural laws outside the solver, one JSON object a line on standard output; progress
// on standard error. bench_torch.py measures the published law as PyTorch runs it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "bench/bench_main.hpp"
#include "bench/measure.hpp"
#include "bench/probe.hpp"
#include "material/neural/isotropic_law.hpp"
#include "material/neural/isotropic_weights.hpp"
#include "material/neural/published_law.hpp"

namespace matterfit::bench {
namespace {

constexpr double kStrain = 0.1;  // of each entry of F − I
constexpr double kSubstep = 5e-4;
// Operations of both nets: a product and a sum a weight, and as many back by points and by weights.
constexpr double kForwardFlops = 2.0 * 2.0 * double(material::kNetWeights);
constexpr double kBothFlops = 3.0 * kForwardFlops;

std::vector<float> random_numbers(std::size_t count, float size, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> uniform(-size, size);
  std::vector<float> all(count);
  for (float& one : all) one = uniform(random);
  return all;
}

/// [points, 9] about the identity.
std::vector<float> random_deformations(std::size_t points) {
  std::vector<float> all = random_numbers(9 * points, static_cast<float>(kStrain), 1);
  for (std::size_t p = 0; p < points; ++p) {
    for (std::size_t axis = 0; axis < 3; ++axis) all[9 * p + 4 * axis] += 1.0F;
  }
  return all;
}

/// Weights that such nets begin with: uniform, by the number of inputs.
std::vector<float> random_net(std::uint64_t seed) {
  using material::kNetFeatures;
  using material::kNetHidden;
  std::vector<float> all;
  const std::size_t shapes[3][2] = {
      {kNetFeatures, kNetHidden}, {kNetHidden, kNetHidden}, {kNetHidden, material::kNetOutputs}};
  for (const auto& [in, out] : shapes) {
    const std::vector<float> layer =
        random_numbers(in * out, 1.0F / std::sqrt(static_cast<float>(in)), seed++);
    all.insert(all.end(), layer.begin(), layer.end());
  }
  return all;
}

struct Calls {
  std::string law;
  bool counted;  ///< kForwardFlops are its operations
  std::function<void()> forward;
  std::function<void()> backward;
};

void measure_law(const Calls& calls, std::size_t points, int threads, double seconds,
                 int repetitions) {
  const auto rate = [&](bool back) {
    return measure(
        [&] {
          using Clock = std::chrono::steady_clock;
          const auto start = Clock::now();
          double took = 0.0;
          double steps = 0.0;
          while (took < seconds) {
            calls.forward();
            if (back) calls.backward();
            steps += static_cast<double>(points);
            took = std::chrono::duration<double>(Clock::now() - start).count();
          }
          return std::pair(steps, took);
        },
        threads, repetitions);
  };
  const Measurement forward = rate(false);
  const Measurement both = rate(true);
  const auto fraction = [&](const Measurement& m, double flops) {
    return calls.counted ? fmt::format("{:.3f}", m.mps * 1e-3 * flops / m.probe_gflops)
                         : std::string("null");
  };
  std::printf(
      "{\"name\": \"neural\", \"law\": \"%s\", \"points\": %zu, \"threads\": %d, "
      "\"forward_mps\": %.3f, \"forward_backward_mps\": %.3f, \"forward_ms\": %.3f, "
      "\"probe_gflops\": %.1f, \"forward_probe_fraction\": %s, "
      "\"forward_backward_probe_fraction\": %s, \"dropped\": %d}\n",
      calls.law.c_str(), points, threads, forward.mps, both.mps,
      static_cast<double>(points) / forward.mps * 1e-3, forward.probe_gflops,
      fraction(forward, kForwardFlops).c_str(), fraction(both, kBothFlops).c_str(),
      forward.dropped + both.dropped);
  std::fflush(stdout);
}

void measure_all(std::size_t points, int threads, double seconds, int repetitions) {
  Arena arena(threads);
  const std::vector<float> trial = random_deformations(points);
  const std::vector<float> elastic_bar = random_numbers(9 * points, 1.0F, 5);
  const std::vector<float> tau_bar = random_numbers(9 * points, 1.0F, 6);
  std::vector<float> elastic(9 * points);
  std::vector<float> tau(9 * points);
  std::vector<float> trial_bar(9 * points);
  std::vector<double> weights_bar(2 * material::kNetWeights);
  const material::PublishedWeights nets{random_net(10), random_net(20)};
  for (const auto mode : {material::GeluMode::kExact, material::GeluMode::kPolynomial}) {
    const Calls published{
        mode == material::GeluMode::kExact ? "published, exact GELU" : "published", true,
        [&, mode] { material::published_forward<float>(nets, mode, trial, elastic, tau, arena); },
        [&, mode] {
          material::published_backward<float>(nets, mode, trial, elastic_bar, tau_bar, trial_bar,
                                              weights_bar, arena);
        }};
    measure_law(published, points, threads, seconds, repetitions);
  }

  const material::IsotropicWeights law = material::plain_isotropic(1e5, 2e5);
  const std::vector<float> strain(points);
  const std::vector<float> six_bar = random_numbers(6 * points, 1.0F, 7);
  std::vector<float> strain_after(points);
  std::vector<float> six(6 * points);
  std::vector<float> strain_bar(points);
  std::vector<double> isotropic_bar(material::kIsotropicWeights);
  const Calls isotropic{"isotropic", false,
                        [&] {
                          material::isotropic_forward<float>(law, kSubstep, {trial, strain},
                                                             {elastic, strain_after, six}, arena);
                        },
                        [&] {
                          material::isotropic_backward<float>(
                              law, kSubstep, {trial, strain}, {elastic_bar, strain, six_bar},
                              trial_bar, strain_bar,
                              std::span<double, material::kIsotropicWeights>(isotropic_bar), arena);
                        }};
  measure_law(isotropic, points, threads, seconds, repetitions);
}

int run(int argc, char** argv) {
  std::vector<std::size_t> sizes{1'000, 100'000};
  std::vector<int> thread_counts{1, 2};
  double seconds = 0.5;
  int repetitions = 5;
  CLI::App app("Neural laws in million points a second, forward, and forward with gradients");
  app.add_option("--points", sizes)->capture_default_str();
  app.add_option("--threads", thread_counts)->capture_default_str();
  app.add_option("--seconds", seconds, "of one repetition, at least")->capture_default_str();
  app.add_option("--repetitions", repetitions)->capture_default_str()->check(CLI::Range(1, 99));
  CLI11_PARSE(app, argc, argv);
  for (const std::size_t size : sizes) {
    for (const int threads : thread_counts) {
      std::fprintf(stderr, "%zu points, %d threads\n", size, threads);
      measure_all(size, threads, seconds, repetitions);
    }
  }
  return 0;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  return matterfit::bench::bench_main("neural_bench", matterfit::bench::run, argc, argv);
}
