// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpm/total_node_term.hpp"

namespace matterfit::mpm {

/// The attached masses of a total Lagrangian body: masses m at X add m w wᵀ to the mass matrix
/// (Woodbury, all of them at once: they may share nodes), with first-order weights w. A pin on the
/// same nodes is imposed after them.
class TotalMasses final : public TotalNodeTerm {
 public:
  TotalMasses(const Body& body, const TotalGrid& grid);

  [[nodiscard]] std::vector<std::uint32_t> nodes() const override;
  void push(const NodeMoment& moment, NodeMotion& motion) const override;
  [[nodiscard]] bool pushes() const override { return true; }
  void push_adjoint(const NodeMoment& moment, const std::vector<Vec3d>& acceleration,
                    NodeMotionBar& bar) const override;

 private:
  struct Mass {
    NodeWeights weights;
    double mass;
    double attach;
  };
  /// The first masses of masses_, there from the time of the last on, and (I + W M⁻¹ Wᵀ m)⁻¹.
  struct Group {
    std::size_t count;
    double from;
    Eigen::MatrixXd compliance;  ///< W M⁻¹ Wᵀ [1/kg]
    Eigen::MatrixXd inverse;
  };
  void couple();
  /// The group of the masses that are there at `time`, or null.
  [[nodiscard]] const Group* group(double time) const;

  const TotalGrid& grid_;
  std::vector<Mass> masses_;   ///< by the time they are attached
  std::vector<Group> groups_;  ///< one for each such time, ascending
};

}  // namespace matterfit::mpm
