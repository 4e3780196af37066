// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/nearest.hpp"

namespace matterfit::fit {
namespace {

constexpr double kClearly = 1.02;
constexpr int kSeveral = 2;

}  // namespace

bool leads_astray(std::optional<Nearest>& nearest, double cost, const Eigen::VectorXd& point) {
  if (!nearest || cost < nearest->cost) {
    nearest = Nearest{cost, point, 0};
    return false;
  }
  if (cost >= kClearly * nearest->cost) ++nearest->worse;
  return nearest->worse >= kSeveral;
}

}  // namespace matterfit::fit
