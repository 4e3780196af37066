// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "mpm/scene.hpp"
#include "mpm/total_grid.hpp"

namespace matterfit::mpm {

/// Pins and attached masses of a total Lagrangian body: the nodes whose motion is not that of a
/// free node, and how they move. Accurate below the cell:
/// - a plane pin on the boundary of cells at the body's end holds that plane: there a quadratic
///   spline is the mean of the two nodes beside it, so the node behind is the mirror image of the
///   one before, u₀ = 2ū − u₁, masses and forces folded;
/// - any other pin constrains points of the held region, Σ w_I(X_c) v_I = v̄, through (C M⁻¹ Cᵀ)⁻¹,
///   rank-checked and factorised once;
/// - masses m at X add m w wᵀ to the mass matrix (Woodbury, all of them at once: they may share
///   nodes), with first-order weights w. A clamp on the same nodes is imposed after them.
class TotalPins {
 public:
  TotalPins(const Body& body, const TotalGrid& grid);

  /// Marks of nodes that step() handles, a byte a node.
  [[nodiscard]] const std::vector<std::uint8_t>& deferred() const { return deferred_; }
  [[nodiscard]] bool any() const { return !nodes_.empty(); }
  [[nodiscard]] bool has_masses() const { return !masses_.empty(); }
  [[nodiscard]] bool held(double time) const;
  [[nodiscard]] bool releases_between(double from, double to) const;

  /// Moves the deferred nodes from `time` to time + dt. `acceleration`: f/m + g of each node of
  /// deferred_nodes(), body axes.
  void step(double kick, double dt, double time, const Vec3d& gravity,
            const std::vector<Vec3d>& acceleration, std::vector<double>& displacement,
            std::vector<double>& velocity) const;
  [[nodiscard]] const std::vector<std::uint32_t>& deferred_nodes() const { return nodes_; }

  /// The transpose of step(), which is affine in accelerations, velocities and displacements. The
  /// fields hold the cotangents of the state after, and get those of the state before, at deferred
  /// nodes; `acceleration_bar` those of f/m + g. `gravity_bar` (body axes) and `log_density_bar`
  /// (masses of nodes, at given accelerations) are sums; `acceleration` as in step().
  void step_adjoint(double kick, double dt, double time, const Vec3d& gravity,
                    const std::vector<Vec3d>& acceleration, std::vector<double>& displacement_bar,
                    std::vector<double>& velocity_bar, std::vector<Vec3d>& acceleration_bar,
                    Vec3d& gravity_bar, double& log_density_bar) const;

 private:
  struct Mirror {
    std::uint32_t free;
    std::uint32_t ghost;
  };
  /// Rows of C on the deferred nodes (indices into nodes_), and the factor of C M⁻¹ Cᵀ.
  struct PointConstraints {
    std::vector<Vec3d> points;  ///< local, at rest
    std::vector<NodeWeights> rows;
    Eigen::MatrixXd factor;  ///< lower Cholesky factor
  };
  struct Clamp {
    Pin pin;
    std::vector<std::uint32_t> prescribed;
    std::vector<Mirror> mirrors;
    PointConstraints constraints;
  };
  struct Mass {
    NodeWeights weights;
    double mass;
    double attach;
  };
  /// The first masses of masses_, there from the time of the last on, and (I + W M⁻¹ Wᵀ m)⁻¹.
  struct MassGroup {
    std::size_t count;
    double from;
    Eigen::MatrixXd compliance;  ///< W M⁻¹ Wᵀ [1/kg]
    Eigen::MatrixXd inverse;
  };

  /// False if there is material behind the plane: then points are constrained.
  [[nodiscard]] bool add_plane(Clamp& clamp, int axis, int side);
  void add_constraints(Clamp& clamp, const Body& body);
  void couple_masses();
  /// Displacement and velocity that the pin prescribes for the material point at rest `local`.
  [[nodiscard]] Vec3d target(const Pin& pin, const Vec3d& local, double time) const;

  const TotalGrid& grid_;
  std::vector<Clamp> clamps_;
  std::vector<Mass> masses_;            ///< by the time they are attached
  std::vector<MassGroup> mass_groups_;  ///< one for each such time, ascending
  std::vector<std::uint32_t> nodes_;    ///< sorted
  std::vector<std::uint8_t> deferred_;
};

}  // namespace matterfit::mpm
