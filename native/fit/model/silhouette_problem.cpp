// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/silhouette_problem.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

constexpr std::size_t kStretches = 8;
/// Of what is not blurred: a pixel's own width.
constexpr double kPixel = 0.5;
/// Standard deviations of a particle that are tried [particle separations].
constexpr std::array<double, 12> kSizes = {0.05, 0.1, 0.15, 0.2,  0.25, 0.3,
                                           0.35, 0.4, 0.5,  0.65, 0.8,  1.0};

double sum_of(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

/// What is drawn, as far as the recording's lens saw it.
Coverage seen_of(const Sighting& sighting, const std::vector<float>& mask) {
  Coverage ours{sighting.matte.width, sighting.matte.height, mask};
  for (std::size_t i = 0; i < sighting.seen.size(); ++i) ours.values[i] *= sighting.seen[i];
  return ours;
}

}  // namespace

SilhouetteProblem::SilhouetteProblem(const SilhouetteModel& model,
                                     std::vector<Parameter> parameters,
                                     std::vector<Sighting> sightings, double blur_pixels)
    : model_(model),
      parameters_(std::move(parameters)),
      sightings_(std::move(sightings)),
      blur_(blur_pixels) {
  views_.reserve(sightings_.size());
  first_.reserve(sightings_.size() + 1);
  std::size_t at = 0;
  for (Sighting& sighting : sightings_) {
    blur(sighting.matte, blur_);
    outlines_ += outline_length(sighting.matte);
    views_.push_back(sighting.view);
    first_.push_back(at);
    at += sighting.matte.values.size();
  }
  first_.push_back(at);
}

std::vector<double> SilhouetteProblem::physical(const Eigen::VectorXd& point) const {
  std::vector<double> values;
  values.reserve(parameters_.size());
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    values.push_back(value_within_bounds(parameters_[k], point[Eigen::Index(k)]));
  }
  return values;
}

std::vector<std::optional<Eigen::VectorXd>> SilhouetteProblem::evaluate(
    const std::vector<Eigen::VectorXd>& points) {
  std::vector<std::vector<double>> values;
  std::vector<Eigen::VectorXd> residuals(points.size());
  std::vector<SilhouetteModel::Sink> sinks;
  values.reserve(points.size());
  sinks.reserve(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    values.push_back(physical(points[p]));
    residuals[p] = Eigen::VectorXd::Zero(Eigen::Index(first_.back()));
    sinks.emplace_back(
        [this, &residual = residuals[p]](std::size_t v, const std::vector<float>& mask) {
          const Sighting& sighting = sightings_[v];
          Coverage ours = seen_of(sighting, mask);
          blur(ours, blur_);
          const double edge = std::hypot(blur_, kPixel);
          const double weight = 1.0 / coverage_deviation(sighting.noise, edge);
          for (std::size_t i = 0; i < ours.values.size(); ++i) {
            residual[Eigen::Index(first_[v] + i)] =
                weight * double(ours.values[i] - sighting.matte.values[i]);
          }
        });
  }
  const std::vector<std::string> failures = model_.draw(values, views_, sinks);
  std::vector<std::optional<Eigen::VectorXd>> results(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (failures[p].empty()) {
      results[p] = std::move(residuals[p]);
    } else {
      failure_ = failures[p];
    }
  }
  count_ += static_cast<int>(points.size());
  if (simulated) simulated(count_);
  return results;
}

double SilhouetteProblem::effective(const Eigen::VectorXd& /*residual*/) const { return outlines_; }

std::vector<std::uint32_t> SilhouetteProblem::blocks() const {
  std::vector<std::uint32_t> result(first_.back());
  for (std::size_t v = 0; v < sightings_.size(); ++v) {
    const auto stretch = static_cast<std::uint32_t>(v * kStretches / sightings_.size());
    std::fill(result.begin() + std::ptrdiff_t(first_[v]),
              result.begin() + std::ptrdiff_t(first_[v + 1]), stretch);
  }
  return result;
}

void settle_sizes(const SilhouetteModel& model, const std::vector<double>& values,
                  std::vector<Sighting>& sightings) {
  std::map<std::size_t, std::size_t> first;  // sighting of each camera
  std::vector<SilhouetteView> views;
  std::vector<std::size_t> of;
  for (std::size_t s = 0; s < sightings.size(); ++s) {
    if (sightings[s].held_out || !(sum_of(sightings[s].matte.values) > 1.0)) continue;
    if (!first.emplace(sightings[s].camera, s).second) continue;
    for (const double size : kSizes) {
      views.push_back(sightings[s].view);
      views.back().size = size;
      of.push_back(s);
    }
  }
  std::vector<double> areas(views.size(), 0.0);
  const SilhouetteModel::Sink sink = [&](std::size_t v, const std::vector<float>& mask) {
    areas[v] = sum_of(seen_of(sightings[of[v]], mask).values);
  };
  const std::vector<std::string> failures = model.draw({values}, views, {sink});
  if (!failures.front().empty()) throw_compute(failures.front());
  std::map<std::size_t, double> sizes;
  for (std::size_t begin = 0; begin < views.size(); begin += kSizes.size()) {
    const Sighting& sighting = sightings[of[begin]];
    const double wanted = sum_of(sighting.matte.values);
    const double* area = areas.data() + begin;
    const std::string name = "camera " + std::to_string(sighting.camera);
    if (!(area[kSizes.size() - 1] > 0.0)) {
      throw_input(name +
                  " looks away: it sees nothing of the simulated body where its matte shows one. "
                  "Are 'up', 'unit' and the body's place right?");
    }
    std::size_t k = 1;
    while (k < kSizes.size() && area[k] < wanted) ++k;
    if (k == kSizes.size() || area[0] > wanted) {
      throw_input(
          name + ": the matte at its first image covers " +
          std::to_string(static_cast<int>(100.0 * wanted / area[kSizes.size() / 2])) +
          " % of what the simulated body does. Are 'unit', the camera's lens and the body's "
          "shape and place right?");
    }
    const double share = std::clamp((wanted - area[k - 1]) / (area[k] - area[k - 1]), 0.0, 1.0);
    sizes[sighting.camera] = kSizes[k - 1] + share * (kSizes[k] - kSizes[k - 1]);
  }
  double mean = 0.0;
  for (const auto& [camera, size] : sizes) mean += size / double(sizes.size());
  for (Sighting& sighting : sightings) {
    const auto size = sizes.find(sighting.camera);
    sighting.view.size = size != sizes.end() ? size->second : mean;
  }
}

}  // namespace matterfit::fit
