// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/capture.hpp"

#include <algorithm>
#include <cmath>

#include "base/parallel.hpp"
#include "fit/data/metrics.hpp"

namespace matterfit::fit {
namespace {

/// Upper limit on the points of one frame's cloud that are compared; more cost time and hardly
/// reduce the variance.
constexpr std::size_t kMostCompared = 8192;

}  // namespace

std::string CaptureInput::label(std::size_t point) const {
  return point < tracks.labels.size() ? tracks.labels[point] : std::to_string(point);
}

double Capture::deviation(std::size_t point) const {
  const std::size_t samples = clouds ? 0 : input.rest_samples[point];
  return sigma[point] * std::sqrt(samples > 0 ? 1.0 + 1.0 / double(samples) : 1.0);
}

std::vector<std::size_t> Capture::frames_in(const std::vector<std::uint8_t>& mask) const {
  const auto points = static_cast<std::ptrdiff_t>(input.tracks.points);
  std::vector<std::size_t> frames;
  auto begin = mask.begin();
  for (std::size_t t = 0; t < input.tracks.frames(); ++t, begin += points) {
    const bool any =
        std::any_of(begin, begin + points, [](std::uint8_t mark) { return mark != 0; });
    if (any) frames.push_back(t);
  }
  return frames;
}

std::vector<std::size_t> Capture::compared(std::size_t frame,
                                           const std::vector<std::uint8_t>& mask) const {
  const std::size_t points = input.tracks.points;
  std::vector<std::size_t> seen;
  for (std::size_t i = 0; i < points; ++i) {
    if (mask[frame * points + i] != 0) seen.push_back(i);
  }
  if (!clouds || seen.size() <= kMostCompared) return seen;
  std::vector<std::size_t> drawn;
  drawn.reserve(kMostCompared);
  for (const std::size_t k : draw(seen.size(), kMostCompared, frame)) drawn.push_back(seen[k]);
  return drawn;
}

CloudScale Capture::cloud_scale(const std::vector<std::uint8_t>& mask) const {
  const std::size_t frame = frames_in(mask).front();
  Points points;
  double noise = 0.0;
  for (const std::size_t i : compared(frame, mask)) {
    points.push_back(input.tracks.positions[frame * input.tracks.points + i]);
    noise = std::max(noise, sigma[i]);
  }
  Arena arena(1);
  return fit::cloud_scale(points, noise, arena);
}

}  // namespace matterfit::fit
