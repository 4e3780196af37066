// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <vector>

#include "mpm/total_grid.hpp"

namespace matterfit::mpm {
namespace {

/// The share of a full node's mass that each node that carries any is given at least. What more
/// gains, and what it costs a block that sticks on a slope: docs/dev/solids.md. The corner of a
/// single full cell has five times as much, so that bodies of full cells stay as they are.
constexpr double kLeastShare = 1e-3;
/// The share of a full node's mass below which nodes neither give nor get.
constexpr double kHeavy = 0.1;
/// The share of its own mass that a donor keeps.
constexpr double kKept = 0.7;

/// Where mass comes from: steps from a light node along one direction, the lengths of which make
/// the shift keep mass and centre of mass: of one unit that arrives, far/(far − near) leave the
/// near donor and near/(far − near) of it go to the far one.
struct Donors {
  int near;
  int far;
};
constexpr std::array<Donors, 2> kDonors = {Donors{1, 2}, Donors{2, 3}};

}  // namespace

/// A node that the body hardly reaches carries next to no mass, but the force of a contact on the
/// faces there falls off by one power less of how far it reaches: it would fly at many times the
/// impact's speed, strain the points around it and shorten the substep. Such a node is given a
/// share of a full one's mass, from heavier nodes along lines, so that the body's mass, its centre
/// and the momentum of any affine motion are as before. All masses stay positive.
void TotalGrid::raise_light_nodes(double density) {
  const double full = density * dx_ * dx_ * dx_;
  const double least = kLeastShare * full;
  mass_ = lumped_mass_;
  for (std::uint32_t n = 0; n < mass_.size(); ++n) {
    if (!(lumped_mass_[n] > 0.0)) continue;
    // From whom most is to be had, until it is enough or nobody has any left.
    while (mass_[n] < least) {
      double most = 0.0;
      std::uint32_t near = kNoBlock;
      std::uint32_t far = kNoBlock;
      double given = 0.0;
      for (int d = 0; d < 27; ++d) {
        const Vec3i step(d / 9 - 1, d / 3 % 3 - 1, d % 3 - 1);
        if (step.isZero()) continue;
        for (const Donors& donors : kDonors) {
          const std::uint32_t first = find_node(node_coordinates(n) + donors.near * step);
          const std::uint32_t second = find_node(node_coordinates(n) + donors.far * step);
          if (first == kNoBlock || second == kNoBlock) continue;
          if (std::min(lumped_mass_[first], lumped_mass_[second]) < kHeavy * full) continue;
          const double spare = mass_[first] - kKept * lumped_mass_[first];
          const double share = static_cast<double>(donors.far) / (donors.far - donors.near);
          if (spare / share <= most) continue;
          most = spare / share;
          near = first;
          far = second;
          given = share;
        }
      }
      if (near == kNoBlock) break;  // too thin a body to give any
      const double taken = std::min(most, least - mass_[n]);
      mass_[n] += taken;
      mass_[near] -= given * taken;
      mass_[far] += (given - 1.0) * taken;
      if (taken < 1e-6 * least) break;
    }
  }
}

}  // namespace matterfit::mpm
