// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "fit/model/quantity.hpp"
#include "job/diagnosis/scene_model.hpp"

namespace matterfit::job {

using Eigen::Index;

void SceneModel::begin_also_from(std::vector<double> before) {
  if (before.size() != fitted_count_) {
    throw_compute(fmt::format("{} numbers from before a fit of {}.", before.size(), fitted_count_));
  }
  before_ = std::move(before);
}

void SceneModel::set_throws(std::vector<double>& values) const {
  if (inertias_.empty()) return;
  const fit::Quantity* const velocity = &fit::row_named(fit::Owner::kBody, "velocity");
  const fit::Quantity* const spin = &fit::row_named(fit::Owner::kBody, "spin");
  bool shared = false;  // the throw that runs share is set
  for (std::size_t r = 0; r < runs().size(); ++r) {
    const mpm::Scene& scene = built({}, r)->scene;
    const auto first = std::ranges::find(nuisances_.impacts(), r, &Impact::run);
    if (scene.bodies.size() != 1 || first == nuisances_.impacts().end()) continue;
    const std::optional<ShootingNode> node = first_flight(*first);
    if (!node) continue;
    const std::optional<RigidState> state = flight_state(*node, inertias_[r], 0.0, {});
    if (!state) continue;
    const auto of_run = [&](const fit::Address& at) {
      if (at.capture.empty()) return !shared;
      return std::ranges::any_of(runs()[r].captures, [&](const fit::Capture& capture) {
        return capture.input.name == at.capture;
      });
    };
    for (std::size_t k = 0; k < fitted_count_; ++k) {
      const fit::Address& at = parameters_->path(k);
      if (!of_run(at) || !at.component) continue;
      if (at.quantity == velocity) values[k] = state->velocity[*at.component];
      if (at.quantity == spin) values[k] = state->spin[*at.component];
    }
    shared = true;
  }
}

std::vector<Eigen::VectorXd> SceneModel::other_starts() const {
  // A fit that has gone astray ends at several times the stiffness, or at a fraction of it.
  constexpr std::array<double, 3> kFactors = {1.0, 4.0, 0.25};
  if (before_.empty() || nuisances_.impacts().empty()) return {};
  std::vector<double> thrown;
  for (std::size_t k = 0; k < fitted_count_; ++k) thrown.push_back(listed_[k].start);
  set_throws(thrown);
  std::vector<std::vector<double>> all = {thrown};
  for (const double factor : kFactors) {
    std::vector<double>& values = all.emplace_back(thrown);
    for (std::size_t k = 0; k < fitted_count_; ++k) {
      const fit::Quantity& row = *parameters_->path(k).quantity;
      if (row.is_material()) values[k] = before_[k] * (row.unit == "Pa" ? factor : 1.0);
    }
  }
  std::vector<Eigen::VectorXd> starts;
  for (const std::vector<double>& values : all) {
    Eigen::VectorXd& theta = starts.emplace_back(start_point().theta);
    for (std::size_t k = 0; k < fitted_count_; ++k) {
      const fit::Parameter& parameter = listed_[k];
      theta[static_cast<Index>(k)] = fit::to_natural(
          parameter.coordinate, std::clamp(values[k], parameter.low, parameter.high));
    }
  }
  return starts;
}

}  // namespace matterfit::job
