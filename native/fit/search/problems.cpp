// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/problems.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "fit/data/metrics.hpp"

namespace matterfit::fit {
namespace {

/// A start is poor where it misses the capture by so many times the noise, and by this part of the
/// body's size.
constexpr double kPoorNoise = 2.5;
constexpr double kPoorSize = 0.005;
/// Clouds: so many times what two samplings of one body miss each other by. That is a mean over
/// many, and well known; smoothing hides much of how far the bodies are off. A body's own surface
/// is that of its particles, which a smooth one misses by some more.
constexpr double kPoorCloud = 1.05;
constexpr double kFarCloud = 1.1;
constexpr double kFarSurface = 1.3;

}  // namespace

SearchProblems::SearchProblems(SearchSetup setup, const Interrupter& interrupter)
    : setup_(std::move(setup)),
      predictor_(*setup_.experiment, setup_.parameters,
                 {setup_.options.loss, setup_.target, setup_.threads, setup_.memory_limit_gb},
                 interrupter, setup_.builders) {}

CaptureProblem SearchProblems::problem(double level, const Window& window,
                                       const std::vector<Parameter>& parameters) {
  return {model(level), runs(), parameters, setup_.options.loss, window, used_samples(runs())};
}

double SearchProblems::alike() const {
  double sigma = 0.0;
  for (const Run& run : runs()) {
    for (const Capture& capture : run.captures) {
      if (capture.used_count > 0) sigma = std::max(sigma, capture.cloud_scale().sigma);
    }
  }
  return mean_length(sigma);
}

double SearchProblems::far() const {
  if (setup_.options.loss == Loss::kTracks) return poor();
  return alike() * (setup_.options.loss == Loss::kSurface ? kFarSurface : kFarCloud);
}

double SearchProblems::poor() const {
  if (setup_.options.loss != Loss::kTracks) return kPoorCloud * alike();
  const auto& runs = this->runs();
  double sigma = 0.0;
  double size = 0.0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (const Capture& capture : runs[r].captures) {
      if (capture.used_count == 0) continue;
      double mean = 0.0;
      for (std::size_t i = 0; i < capture.sigma.size(); ++i) {
        mean += capture.deviation(i) / double(capture.sigma.size());
      }
      sigma = std::max(sigma, mean);
      const mpm::Scene& scene = scenes()[r];
      size = std::max(size, body_size(scene.bodies[body_index(scene, capture.input.body)].rest));
    }
  }
  return std::max(kPoorNoise * sigma, kPoorSize * size);
}

double mean_value(const std::vector<double>& distances) {
  double sum = 0.0;
  for (const double value : distances) sum += value;
  return distances.empty() ? 0.0 : sum / double(distances.size());
}

}  // namespace matterfit::fit
