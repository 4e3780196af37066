// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/start_limit.hpp"

#include <algorithm>
#include <numeric>

#include "fit/data/follow.hpp"
#include "mpm/step_limit.hpp"

namespace matterfit::fit {
namespace {

constexpr double kMostFromStart = 300.0;
constexpr double kMoreThanStart = 10.0;

}  // namespace

StartLimit::StartLimit(const std::vector<Run>& runs, const std::vector<mpm::Scene>& scenes,
                       const Parameters& parameters)
    : parameters_(parameters), scenes_(scenes) {
  const std::vector<double> starts = parameters.starts();
  for (std::size_t r = 0; r < scenes_.size(); ++r) {
    for (mpm::Body& body : scenes_[r].bodies) {
      body.rest.clear();
      // Contact's default stiffness follows the body's size.
      body.volumes = {std::accumulate(body.volumes.begin(), body.volumes.end(), 0.0)};
    }
    if (!runs[r].fitted) continue;
    for (const std::string& name : parameters.moved_materials(r)) {
      Entry entry{r, name, 0.0};
      entry.most = std::max(kMostFromStart, kMoreThanStart * substeps(starts, entry));
      entries_.push_back(std::move(entry));
    }
  }
}

double StartLimit::substeps(std::span<const double> values, const Entry& entry) const {
  mpm::Scene scene = scenes_[entry.run];
  parameters_.apply(values, entry.run, scene);
  const mpm::Body& body = scene.bodies[body_index(scene, entry.body)];
  return 1.0 / (scene.fps * scene.dt_safety * mpm::step_limit(scene, body));
}

bool StartLimit::allows(std::span<const double> values) const {
  return std::all_of(entries_.begin(), entries_.end(),
                     [&](const Entry& entry) { return substeps(values, entry) <= entry.most; });
}

std::vector<double> StartLimit::softened(std::vector<double> values) const {
  const std::vector<double> given = values;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!parameters_.path(i).quantity->stiffness) continue;
    double ratio = 1.0;
    for (const Entry& entry : entries_) {
      if (entry.body != parameters_.path(i).owner || !parameters_.acts_on(i, entry.run)) continue;
      ratio = std::min(ratio, entry.most / substeps(given, entry));
    }
    const Parameter& parameter = parameters_.parameters()[i];
    values[i] = std::clamp(ratio * ratio * given[i], parameter.low, parameter.high);
  }
  return values;
}

}  // namespace matterfit::fit
