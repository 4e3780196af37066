// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/state_box.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace matterfit::diagnose {

using Eigen::Index;
using Eigen::VectorXd;

VectorXd scales_of(const Model& model, const State& state) {
  std::vector<double> scales;
  for (const fit::Parameter& parameter : model.parameters()) scales.push_back(parameter.scale);
  for (const Active& cause : state.causes) {
    for (const Number& number : model.effects()[std::size_t(cause.effect)].numbers) {
      scales.push_back(number.scale);
    }
  }
  return Eigen::Map<const VectorXd>(scales.data(), Index(scales.size()));
}

fit::Box box_of(const Model& model, const State& state) {
  std::vector<double> low;
  std::vector<double> high;
  for (const fit::Parameter& parameter : model.parameters()) {
    low.push_back(fit::to_natural(parameter.coordinate, parameter.low));
    high.push_back(fit::to_natural(parameter.coordinate, parameter.high));
  }
  for (const Active& cause : state.causes) {
    for (const Number& number : model.effects()[std::size_t(cause.effect)].numbers) {
      low.push_back(number.one_sided ? std::max(number.neutral, number.low) : number.low);
      high.push_back(number.high);
    }
  }
  return {Eigen::Map<const VectorXd>(low.data(), Index(low.size())),
          Eigen::Map<const VectorXd>(high.data(), Index(high.size()))};
}

fit::Box room_about(const VectorXd& values, const fit::Box& bounds, const VectorXd& scales) {
  constexpr double kMost = 1e6;
  return {(bounds.low - values).cwiseQuotient(scales).cwiseMin(0.0).cwiseMax(-kMost),
          (bounds.high - values).cwiseQuotient(scales).cwiseMax(0.0).cwiseMin(kMost)};
}

}  // namespace matterfit::diagnose
