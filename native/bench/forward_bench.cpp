// SPDX-License-Identifier: GPL-3.0-or-later
// Speed of the forward solver beside the serial yardstick, one JSON object a line on standard
// output; progress on standard error. Both simulate the same cube of jelly falling on a floor.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "bench/bench_main.hpp"
#include "bench/jelly.hpp"
#include "bench/measure.hpp"
#include "bench/probe.hpp"
#include "bench/serial_mpm.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::bench {
namespace {

// Operations a particle and substep, counted on paper for quadratic 3D transfers with fixed
// corotated elasticity: 27 nodes × (22 to scatter + 24 to gather) + weights, F, R, stress.
constexpr double kFlopsPerParticleStep = 1350.0;

void print(const std::string& name, const std::string& formulation, int threads,
           std::size_t particles, const Measurement& m, double serial_mps) {
  const double fraction = m.mps * 1e-3 * kFlopsPerParticleStep / m.probe_gflops;
  std::printf(
      "{\"name\": \"%s\", \"formulation\": \"%s\", \"threads\": %d, \"particles\": %zu, "
      "\"mps\": %.3f, \"probe_gflops\": %.1f, \"probe_fraction\": %.4f, \"ratio_to_serial\": %.2f, "
      "\"dropped\": %d}\n",
      name.c_str(), formulation.c_str(), threads, particles, m.mps, m.probe_gflops, fraction,
      serial_mps > 0.0 ? m.mps / serial_mps : 0.0, m.dropped);
  std::fflush(stdout);
}

Measurement measure_serial(int edge, double seconds, int repetitions) {
  SerialMpm::Options options;
  options.dx = static_cast<float>(2.0 * kSeparation);
  options.dt = static_cast<float>(kDt);
  options.mu = static_cast<float>(kYoungsModulus / (2.0 * (1.0 + kPoissonRatio)));
  options.lambda = static_cast<float>(kYoungsModulus * kPoissonRatio /
                                      ((1.0 + kPoissonRatio) * (1.0 - 2.0 * kPoissonRatio)));
  options.grid = edge / 2 + 5 * kClearanceCells;
  std::vector<SerialMpm::Particle> particles;
  const double side = edge * kSeparation;
  const double volume = kSeparation * kSeparation * kSeparation;
  const auto place = [](int i, int cells) {
    return static_cast<float>((0.5 + i) * kSeparation + cells * 2.0 * kSeparation);
  };
  for (int i = 0; i < edge; ++i) {
    for (int j = 0; j < edge; ++j) {
      for (int k = 0; k < edge; ++k) {
        SerialMpm::Particle p{};
        // Room below, so that it falls, touches the floor and wobbles while it is measured.
        p.x = {place(i, 2 * kClearanceCells), place(j, 2 * kClearanceCells),
               place(k, kClearanceCells)};
        const Vec3d v = initial_velocity(kSeparation * Vec3d(i + 0.5, j + 0.5, k + 0.5), side);
        p.v = {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
        p.F = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        p.mass = static_cast<float>(kDensity * volume);
        p.volume = static_cast<float>(volume);
        particles.push_back(p);
      }
    }
  }
  const std::size_t count = particles.size();
  SerialMpm serial(std::move(particles), options);
  return measure(
      [&] {
        using Clock = std::chrono::steady_clock;
        const auto start = Clock::now();
        double took = 0.0;
        double steps = 0.0;
        while (took < seconds) {
          serial.step();
          steps += static_cast<double>(count);
          took = std::chrono::duration<double>(Clock::now() - start).count();
        }
        return std::pair(steps, took);
      },
      1, repetitions);
}

Measurement measure_forward(int edge, mpm::Formulation formulation, int threads, double seconds,
                            int repetitions) {
  mpm::Simulation simulation(jelly(edge, formulation, kClearanceCells),
                             std::make_shared<Arena>(threads));
  const double count = std::pow(edge, 3);
  const Interrupter interrupter;
  return measure(
      [&] {
        double took = 0.0;
        double steps = 0.0;
        using Clock = std::chrono::steady_clock;
        const auto start = Clock::now();
        while (took < seconds) {
          steps += count * simulation.advance(interrupter).substeps;
          took = std::chrono::duration<double>(Clock::now() - start).count();
        }
        return std::pair(steps, took);
      },
      threads, repetitions);
}

int run(int argc, char** argv) {
  std::vector<std::size_t> sizes{10'000, 100'000, 1'000'000};
  std::vector<int> thread_counts{1, 2};
  std::vector<std::string> chosen{"updated", "total", "renewed"};
  double seconds = 1.0;
  int repetitions = 5;
  CLI::App app("Forward speed of the solver in million particle-steps a second");
  app.add_option("--particles", sizes, "about how many particles")->capture_default_str();
  app.add_option("--threads", thread_counts)->capture_default_str();
  app.add_option("--formulations", chosen)
      ->capture_default_str()
      ->check(CLI::IsMember(std::vector<std::string>{"updated", "total", "renewed"}));
  app.add_option("--seconds", seconds, "of one repetition, at least")->capture_default_str();
  app.add_option("--repetitions", repetitions)->capture_default_str()->check(CLI::Range(1, 99));
  CLI11_PARSE(app, argc, argv);

  std::fprintf(stderr, "probe: %s, %.1f GFLOP/s on one thread\n", probe_target().c_str(),
               peak_fma_gflops(1));
  for (const std::size_t size : sizes) {
    const int edge = edge_of(size);
    const std::size_t count = static_cast<std::size_t>(edge) * static_cast<std::size_t>(edge) *
                              static_cast<std::size_t>(edge);
    std::fprintf(stderr, "%zu particles\n", count);
    const Measurement serial = measure_serial(edge, seconds, repetitions);
    print("serial", "updated", 1, count, serial, serial.mps);
    for (const std::string& name : chosen) {
      const mpm::Formulation formulation = formulations().at(name);
      for (const int threads : thread_counts) {
        const Measurement forward =
            measure_forward(edge, formulation, threads, seconds, repetitions);
        print("forward", name, threads, count, forward, serial.mps);
      }
    }
  }
  return 0;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  return matterfit::bench::bench_main("forward_bench", matterfit::bench::run, argc, argv);
}
