// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/particle_sizes.hpp"

#include <algorithm>
#include <array>
#include <exception>
#include <map>
#include <numeric>
#include <optional>
#include <set>
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
  // A coarse body's outline is a rough one: what is not far out takes the nearest size.
  constexpr double kFarOut = 1.5;
  if (wanted > kFarOut * area[kSizes.size() - 1] || area[0] > kFarOut * wanted) {
    throw_input(name + ": the matte covers " +
                std::to_string(static_cast<int>(
                    std::min(1e4, 100.0 * wanted / std::max(area[kSizes.size() / 2], 1e-3)))) +
                " % of what the simulated body does where its size is taken from. Are 'unit', the "
                "camera's lens and the body's "
                "shape and place right?");
  }
  const std::size_t k = std::clamp<std::size_t>(
      std::size_t(std::lower_bound(area, area + kSizes.size(), wanted) - area), 1,
      kSizes.size() - 1);
  const double share = std::clamp((wanted - area[k - 1]) / (area[k] - area[k - 1]), 0.0, 1.0);
  return kSizes[k - 1] + share * (kSizes[k] - kSizes[k - 1]);
}

/// Whether a matte has something along the image's border.
bool is_cut_off(const Coverage& matte) {
  const auto at = [&](int x, int y) {
    return matte.values[std::size_t(y) * std::size_t(matte.width) + std::size_t(x)] > 0.0F;
  };
  for (int x = 0; x < matte.width; ++x) {
    if (at(x, 0) || at(x, matte.height - 1)) return true;
  }
  for (int y = 0; y < matte.height; ++y) {
    if (at(0, y) || at(matte.width - 1, y)) return true;
  }
  return false;
}

/// The sighting of each camera that its particles' size is taken from; of a film that was recorded
/// from the first frame on, of cameras that show that.
std::map<Camera, std::size_t> telling(const std::vector<Sighting>& sightings) {
  std::map<Camera, std::size_t> found;
  std::map<Camera, bool> whole;
  std::set<std::size_t> from_the_start;
  const auto shows = [](const Sighting& sighting) {
    return !sighting.held_out && !sighting.view.by_splats && sum_of(sighting.matte.values) > 1.0;
  };
  for (const Sighting& sighting : sightings) {
    if (shows(sighting) && !(sighting.view.time > 0.0)) from_the_start.insert(sighting.view.film);
  }
  for (std::size_t s = 0; s < sightings.size(); ++s) {
    const Sighting& sighting = sightings[s];
    if (!shows(sighting)) continue;
    if (sighting.view.time > 0.0 && from_the_start.count(sighting.view.film) > 0) continue;
    const double area = sum_of(sighting.matte.values);
    const Camera camera = camera_of(sighting);
    if (whole[camera]) continue;
    whole[camera] = !is_cut_off(sighting.matte);
    const auto [at, fresh] = found.emplace(camera, s);
    if (whole[camera] || area > sum_of(sightings[at->second].matte.values)) at->second = s;
  }
  return found;
}

}  // namespace

void settle_sizes(const std::function<void(const Filming&)>& film,
                  const std::vector<std::string>& names,
                  const std::vector<std::vector<std::uint8_t>>& moved,
                  std::vector<Sighting>& sightings, std::vector<std::string>* faults) {
  Filming filming;
  std::vector<std::size_t> of;
  for (const auto& [camera, s] : telling(sightings)) {
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
    } catch (const Error& error) {
      if (faults != nullptr) {
        faults->emplace_back(error.what());
        continue;
      }
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
