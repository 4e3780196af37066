// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/particle_sizes.hpp"

#include <algorithm>
#include <array>
#include <exception>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

/// Standard deviations of a particle that are tried [particle separations].
constexpr std::array<double, 12> kSizes = {0.05, 0.1, 0.15, 0.2,  0.25, 0.3,
                                           0.35, 0.4, 0.5,  0.65, 0.8,  1.0};

using Camera = std::pair<std::size_t, std::size_t>;  // film, number

Camera camera_of(const Sighting& sighting) { return {sighting.view.film, sighting.view.number}; }

double sum_of(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

/// The size at which the area that was drawn at kSizes is the one that is wanted.
double size_of(const double* area, double wanted, const std::string& name) {
  if (!(area[kSizes.size() - 1] > 0.0)) {
    throw_input(name +
                " looks away: it sees nothing of the simulated body where its matte shows one. "
                "Are 'up', 'unit' and the body's place right?");
  }
  std::size_t k = 1;
  while (k < kSizes.size() && area[k] < wanted) ++k;
  if (k == kSizes.size() || area[0] > wanted) {
    throw_input(name + ": the matte at its first image covers " +
                std::to_string(static_cast<int>(
                    std::min(1e4, 100.0 * wanted / std::max(area[kSizes.size() / 2], 1e-3)))) +
                " % of what the simulated body does. Are 'unit', the camera's lens and the body's "
                "shape and place right?");
  }
  const double share = std::clamp((wanted - area[k - 1]) / (area[k] - area[k - 1]), 0.0, 1.0);
  return kSizes[k - 1] + share * (kSizes[k] - kSizes[k - 1]);
}

}  // namespace

void settle_sizes(const std::function<void(const Filming&)>& film,
                  const std::vector<std::string>& names,
                  const std::vector<std::vector<std::uint8_t>>& moved,
                  std::vector<Sighting>& sightings) {
  std::map<Camera, std::size_t> first;  // sighting of each camera
  Filming filming;
  std::vector<std::size_t> of;
  for (std::size_t s = 0; s < sightings.size(); ++s) {
    if (sightings[s].held_out || sightings[s].view.by_splats) continue;
    if (!(sum_of(sightings[s].matte.values) > 1.0)) continue;
    if (!first.emplace(camera_of(sightings[s]), s).second) continue;
    for (const double size : kSizes) {
      filming.views.push_back(sightings[s].view);
      filming.views.back().size = size;
      of.push_back(s);
    }
  }
  if (of.empty()) {
    for (Sighting& sighting : sightings) sighting.view.size = kUsualSize;
    return;
  }
  std::vector<double> areas(filming.views.size(), 0.0);
  filming.see = [&](std::size_t, std::size_t v, const Drawn& image) {
    const Sighting& sighting = sightings[of[v]];
    areas[v] = sum_of(seen_of(image.mask, sighting.matte, sighting.seen).values);
  };
  film(filming);

  const auto is_moved = [&](const Camera& camera) {
    return camera.first < moved.size() && camera.second < moved[camera.first].size() &&
           moved[camera.first][camera.second] != 0;
  };
  std::map<Camera, double> sizes;
  std::exception_ptr fault;
  for (std::size_t begin = 0; begin < of.size(); begin += kSizes.size()) {
    const Sighting& sighting = sightings[of[begin]];
    const Camera camera = camera_of(sighting);
    const std::string name = names[camera.first] + ": camera " + std::to_string(camera.second);
    try {
      sizes[camera] = size_of(areas.data() + begin, sum_of(sighting.matte.values), name);
    } catch (const Error&) {
      if (!is_moved(camera)) throw;
      fault = std::current_exception();  // its pose is what is looked for
    }
  }
  if (sizes.empty() && fault) std::rethrow_exception(fault);
  /// The mean over a film's cameras, or over all; over those that are not moved, or over all.
  const auto mean = [&](std::optional<std::size_t> film, bool all) -> std::optional<double> {
    double sum = 0.0;
    double count = 0.0;
    for (const auto& [camera, size] : sizes) {
      if ((film && camera.first != *film) || (!all && is_moved(camera))) continue;
      sum += size;
      count += 1.0;
    }
    return count > 0.0 ? std::optional(sum / count) : std::nullopt;
  };
  for (Sighting& sighting : sightings) {
    const Camera camera = camera_of(sighting);
    const auto own = sizes.find(camera);
    if (own != sizes.end() && !is_moved(camera)) {
      sighting.view.size = own->second;
      continue;
    }
    auto size = mean(camera.first, false);
    if (!size) size = mean(camera.first, true);
    if (!size) size = mean(std::nullopt, true);
    sighting.view.size = size.value_or(kUsualSize);
  }
}

}  // namespace matterfit::fit
