// SPDX-License-Identifier: GPL-3.0-or-later
// Speed and memory of gradients of whole runs: forward, and forward and backward with every state
// stored and with checkpoints. One JSON object a line on standard output, a table on standard
// error. The jelly lies on the ground, so contact is part of it.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "bench/bench_main.hpp"
#include "bench/jelly.hpp"
#include "bench/measure.hpp"
#include "bench/probe.hpp"
#include "mpm/gradient.hpp"

namespace matterfit::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kFrames = 2;
constexpr int kSubsteps = 50;  ///< a frame

/// Seconds of a run, without setting it up, in one repetition.
struct Times {
  double forward = 0.0;
  double stored = 0.0;
  double checkpointed = 0.0;
};

class GradientBench {
 public:
  GradientBench(int edge, int threads, mpm::Formulation formulation)
      : scene_(jelly(edge, formulation, 0)), arena_(std::make_shared<Arena>(threads)) {
    scene_.fps = 1.0 / (kSubsteps * kDt);
    scene_.end_frame = kFrames + 1;
    const mpm::Gradient g = differentiate({});
    state_bytes_ = g.state_bytes;
    // A fit has these too; no search for the fastest mode, which a longer run would not feel.
    stored_.schedule = g.schedule;
    checkpointed_.schedule = g.schedule;
    // The material has no damping, and none is looked for.
    stored_.of_no_damping = false;
    checkpointed_.of_no_damping = false;
    // A budget with which at most one state in four can be kept.
    checkpointed_.memory_budget = g.peak_bytes - g.substeps * g.state_bytes * 3 / 4;
    const mpm::Gradient checked = differentiate(checkpointed_);
    peak_bytes_ = checked.peak_bytes;
    recomputed_ = static_cast<double>(checked.recomputed) / static_cast<double>(checked.substeps);
  }

  [[nodiscard]] double particle_steps() const {
    return static_cast<double>(scene_.bodies[0].rest.size()) * kFrames * kSubsteps;
  }
  /// The size of one state [bytes a particle].
  [[nodiscard]] double state_bytes() const { return per_particle(state_bytes_); }
  /// The memory of a whole run with checkpoints [bytes a particle and substep].
  [[nodiscard]] double checkpoint_bytes() const {
    return per_particle(peak_bytes_) / (kFrames * kSubsteps);
  }
  /// Share of the substeps that a run with checkpoints runs twice.
  [[nodiscard]] double recomputed() const { return recomputed_; }

  /// For `seconds` at least, each.
  [[nodiscard]] Times run(double seconds) {
    Times times;
    times.forward = mean_time(seconds, [&] {
      (void)mpm::roll_out<float>(scene_, arena_, observer(), stored_, Interrupter());
    });
    times.stored = mean_time(seconds, [&] { (void)differentiate(stored_); });
    times.checkpointed = mean_time(seconds, [&] { (void)differentiate(checkpointed_); });
    return times;
  }

 private:
  [[nodiscard]] double per_particle(std::size_t bytes) const {
    return static_cast<double>(bytes) / static_cast<double>(scene_.bodies[0].rest.size());
  }
  [[nodiscard]] mpm::Gradient differentiate(const mpm::GradientOptions& options) {
    return mpm::gradient<float>(scene_, arena_, observer(), options, Interrupter());
  }
  /// Squared distances from the origin, and when it was first asked.
  [[nodiscard]] mpm::Observer observer() {
    return [this](const mpm::ObservedFrame& frame, mpm::FrameLoss& loss) {
      if (frame.frame == 0) begin_ = Clock::now();
      for (const Vec3d& x : frame.bodies[0].positions) {
        loss.loss += 0.5 * x.squaredNorm();
        loss.bodies[0].positions.push_back(x);
      }
    };
  }
  template <class Work>
  double mean_time(double seconds, const Work& work) {
    double spent = 0.0;
    int runs = 0;
    while (spent < seconds) {
      work();
      spent += std::chrono::duration<double>(Clock::now() - begin_).count();
      ++runs;
    }
    return spent / runs;
  }

  mpm::Scene scene_;
  std::shared_ptr<Arena> arena_;
  mpm::GradientOptions stored_;
  mpm::GradientOptions checkpointed_;
  std::size_t state_bytes_ = 0;
  std::size_t peak_bytes_ = 0;
  double recomputed_ = 0.0;
  Clock::time_point begin_;
};

/// One line of the table.
void measure(const std::string& name, mpm::Formulation formulation, std::size_t size, int threads,
             double seconds, int repetitions) {
  const int edge = edge_of(size);
  GradientBench bench(edge, threads, formulation);
  std::vector<double> forward;
  std::vector<double> stored;
  std::vector<double> checkpointed;
  std::vector<double> stored_ratio;
  std::vector<double> checkpointed_ratio;
  std::vector<double> probes;
  const int dropped =
      repeat([&] { return bench.run(seconds); }, threads, repetitions,
             [&](const Times& t, double probe) {
               forward.push_back(bench.particle_steps() / t.forward * 1e-6);
               stored.push_back(bench.particle_steps() / t.stored * 1e-6);
               checkpointed.push_back(bench.particle_steps() / t.checkpointed * 1e-6);
               stored_ratio.push_back(t.stored / t.forward - 1.0);
               checkpointed_ratio.push_back(t.checkpointed / t.forward - 1.0);
               probes.push_back(probe);
             });
  const int particles = edge * edge * edge;
  std::fprintf(stderr, "%9d %7d | %7.2f | %7.2f %5.2f %10.1f | %7.2f %5.2f %6.2f %10.2f\n",
               particles, threads, median(forward), median(stored), median(stored_ratio),
               bench.state_bytes(), median(checkpointed), median(checkpointed_ratio),
               bench.recomputed(), bench.checkpoint_bytes());
  std::printf(
      "{\"name\": \"gradient\", \"formulation\": \"%s\", \"threads\": %d, \"particles\": "
      "%d, \"forward_mps\": %.3f, \"stored_mps\": %.3f, \"stored_backward_ratio\": %.3f, "
      "\"state_bytes_per_particle\": %.1f, \"checkpointed_mps\": %.3f, "
      "\"checkpointed_backward_ratio\": %.3f, \"recomputed\": %.3f, "
      "\"checkpointed_bytes_per_particle_step\": %.2f, \"probe_gflops\": %.1f, \"dropped\": "
      "%d}\n",
      name.c_str(), threads, particles, median(forward), median(stored), median(stored_ratio),
      bench.state_bytes(), median(checkpointed), median(checkpointed_ratio), bench.recomputed(),
      bench.checkpoint_bytes(), median(probes), dropped);
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  std::vector<std::size_t> sizes{1'000, 10'000, 100'000};
  std::vector<int> thread_counts{1, 2};
  std::vector<std::string> chosen{"total", "updated"};
  double seconds = 0.3;
  int repetitions = 5;
  CLI::App app("Speed of gradients of whole runs in million particle-steps a second");
  app.add_option("--particles", sizes, "about how many particles")->capture_default_str();
  app.add_option("--threads", thread_counts)->capture_default_str();
  app.add_option("--formulations", chosen)
      ->capture_default_str()
      ->check(CLI::IsMember({"total", "updated", "renewed"}));
  app.add_option("--seconds", seconds, "of one measurement, at least")->capture_default_str();
  app.add_option("--repetitions", repetitions)->capture_default_str()->check(CLI::Range(1, 99));
  CLI11_PARSE(app, argc, argv);

  std::fprintf(stderr, "probe: %s, %.1f GFLOP/s on one thread\n", probe_target().c_str(),
               peak_fma_gflops(1));
  for (const std::string& name : chosen) {
    std::fprintf(stderr, "%9s %7s | %7s | %7s %5s %10s | %7s %5s %6s %10s\n", name.c_str(), "",
                 "forward", "stored", "back", "state", "checkp.", "back", "again", "B/particle");
    std::fprintf(stderr, "%9s %7s | %7s | %7s %5s %10s | %7s %5s %6s %10s\n", "particles",
                 "threads", "Mp/s", "Mp/s", "ratio", "B/particle", "Mp/s", "ratio", "share",
                 "-step");
    for (const std::size_t size : sizes) {
      for (const int threads : thread_counts) {
        measure(name, formulations().at(name), size, threads, seconds, repetitions);
      }
    }
  }
  return 0;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  return matterfit::bench::bench_main("gradient_bench", matterfit::bench::run, argc, argv);
}
