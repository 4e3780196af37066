// SPDX-License-Identifier: GPL-3.0-or-later
// Speed of the Gaussian rasteriser beside the plain serial one, one JSON object a line on standard
// output; progress on standard error. Harmonics of degree 0, colour, mask and depth.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "bench/bench_main.hpp"
#include "bench/measure.hpp"
#include "bench/probe.hpp"
#include "bench/splat_scene.hpp"

namespace matterfit::bench {
namespace {

// A pair of a Gaussian and a pixel with α ≥ 1/255, counted on paper: u, w, their squares, 2^e by
// five terms, α T and five channels; and of the backward pass, which does that again.
constexpr double kForwardFlops = 40.0;
constexpr double kBackwardFlops = 75.0;

struct Seconds {
  double forward;
  double backward;
};

struct Rates {
  double forward_ms;
  double both_ms;
  double probe_gflops;
  int dropped;
};

template <class Forward, class Backward>
Rates measure_rates(int images, int threads, int repetitions, const Forward& forward,
                    const Backward& backward) {
  using Clock = std::chrono::steady_clock;
  const auto since = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  std::vector<double> forwards;
  std::vector<double> both;
  std::vector<double> probes;
  const int dropped = repeat(
      [&] {
        Seconds took{0.0, 0.0};
        for (int i = 0; i < images; ++i) {
          const auto start = Clock::now();
          forward();
          const auto middle = Clock::now();
          backward();
          took.forward += std::chrono::duration<double>(middle - start).count();
          took.backward += since(middle);
        }
        return took;
      },
      threads, repetitions,
      [&](const Seconds& took, double probe) {
        forwards.push_back(took.forward / images * 1e3);
        both.push_back((took.forward + took.backward) / images * 1e3);
        probes.push_back(probe);
      });
  return {median(forwards), median(both), median(probes), dropped};
}

void print(const std::string& name, const std::string& scene, int size, std::size_t count,
           int threads, double visible, const Rates& rates, const Rates& serial) {
  const double forward = visible * kForwardFlops / rates.forward_ms;
  const double both = visible * (kForwardFlops + kBackwardFlops) / rates.both_ms;
  std::printf(
      "{\"name\": \"%s\", \"scene\": \"%s\", \"size\": %d, \"gaussians\": %zu, \"threads\": %d, "
      "\"visible_pairs\": %.0f, \"forward_images_per_s\": %.1f, \"forward_backward_images_per_s\": "
      "%.1f, \"probe_gflops\": %.1f, \"forward_probe_fraction\": %.4f, "
      "\"forward_backward_probe_fraction\": %.4f, \"forward_ratio_to_serial\": %.2f, "
      "\"forward_backward_ratio_to_serial\": %.2f, \"dropped\": %d}\n",
      name.c_str(), scene.c_str(), size, count, threads, visible, 1e3 / rates.forward_ms,
      1e3 / rates.both_ms, rates.probe_gflops, forward * 1e-6 / rates.probe_gflops,
      both * 1e-6 / rates.probe_gflops, serial.forward_ms / rates.forward_ms,
      serial.both_ms / rates.both_ms, rates.dropped);
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  std::vector<int> sizes{400, 800};
  std::vector<int> thread_counts{1, 2};
  std::vector<std::string> names{"object", "surfels", "trained"};
  int images = 10;
  int repetitions = 3;
  CLI::App app("Speed of the Gaussian rasteriser in images a second");
  app.add_option("--sizes", sizes, "edge of the image; 400: 30 000 Gaussians, 800: 60 000")
      ->capture_default_str();
  const std::map<std::string, SplatScene> scenes{{"object", SplatScene::kObject},
                                                 {"surfels", SplatScene::kSurfels},
                                                 {"trained", SplatScene::kTrained}};
  app.add_option("--scenes", names)->capture_default_str()->check(CLI::IsMember(scenes));
  app.add_option("--threads", thread_counts)->capture_default_str();
  app.add_option("--images", images, "of one repetition")->capture_default_str();
  app.add_option("--repetitions", repetitions)->capture_default_str()->check(CLI::Range(1, 99));
  CLI11_PARSE(app, argc, argv);

  std::fprintf(stderr, "probe: %s, %.1f GFLOP/s on one thread\n", probe_target().c_str(),
               peak_fma_gflops(1));
  for (const int size : sizes) {
    const auto count = static_cast<std::size_t>(size) * 75;
    for (const std::string& name : names) {
      const splat::Gaussians scene = splat_scene(scenes.at(name), count);
      const splat::Camera camera = splat_camera(size);
      const splat::Image loss = splat_loss(size);
      SerialSplat yardstick = serial_splat(scene, camera);
      const SerialSplat::Channels channels = serial_channels(loss);
      const Rates serial = measure_rates(
          2, 1, repetitions, [&] { yardstick.render(); }, [&] { yardstick.backward(channels); });
      const auto visible = static_cast<double>(yardstick.visible_pairs());
      print("serial", name, size, count, 1, visible, serial, serial);
      for (const int threads : thread_counts) {
        splat::Rasteriser rasteriser(std::make_shared<Arena>(threads));
        splat::GaussianGradients gradients;
        const Rates rates = measure_rates(
            images, threads, repetitions, [&] { rasteriser.render(scene, camera); },
            [&] { rasteriser.backward(scene, loss, gradients); });
        print("rasteriser", name, size, count, threads, visible, rates, serial);
      }
    }
  }
  return 0;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  return matterfit::bench::bench_main("splat_bench", matterfit::bench::run, argc, argv);
}
