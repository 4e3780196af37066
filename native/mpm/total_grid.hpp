// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "base/interrupter.hpp"
#include "base/vec.hpp"
#include "mpm/kernels.hpp"
#include "mpm/layout.hpp"
#include "mpm/scene.hpp"
#include "mpm/total_quadrature.hpp"

namespace matterfit::mpm {

/// Weights of nodes for a point of the body at rest: Σ w_I = 1, Σ w_I X_I = X.
struct NodeWeights {
  std::vector<std::uint32_t> nodes;  ///< node block · 64 + node
  std::vector<double> weights;
};

/// A point in a cell of a block: cell (x, y, z) of the block, f = x/dx − base.
struct CellPoint {
  std::uint32_t block;
  std::size_t x, y, z;
  Vec3d f;
};

/// The fixed grid of a total Lagrangian body: which blocks there are, where its quadrature points
/// and particles sit, node masses. Everything is in the body's own axes: x_local = axesᵀ (X −
/// origin).
class TotalGrid {
 public:
  TotalGrid(const Body& body, const Scene& scene, const Interrupter* interrupter = nullptr);

  [[nodiscard]] std::size_t particles() const { return rest_.size(); }
  [[nodiscard]] std::size_t blocks() const { return block_nodes_.size(); }
  [[nodiscard]] std::size_t node_blocks() const { return node_sources_.size(); }
  [[nodiscard]] std::size_t chunks() const { return slab_chunks_.back(); }

  [[nodiscard]] double dx() const { return dx_; }
  [[nodiscard]] const Mat3d& axes() const { return axes_; }
  [[nodiscard]] Vec3d to_local(const Vec3d& world) const {
    return axes_.transpose() * (world - origin_);
  }
  [[nodiscard]] Vec3d to_world(const Vec3d& local) const { return axes_ * local + origin_; }
  [[nodiscard]] const Vec3d& rest(std::uint32_t particle) const { return rest_[particle]; }
  [[nodiscard]] double volume(std::uint32_t particle) const { return volumes_[particle]; }
  [[nodiscard]] const std::vector<QuadraturePoint>& quadrature() const {
    return quadrature_.points;
  }
  /// Where quadrature point q is stored: chunk · kLanes + lane.
  [[nodiscard]] std::uint32_t place(std::size_t q) const { return place_[q]; }
  /// The quadrature point whose history a particle shows.
  [[nodiscard]] std::uint32_t nearest_point(std::uint32_t particle) const {
    return quadrature_.nearest[particle];
  }
  [[nodiscard]] std::uint32_t block(std::uint32_t particle) const {
    return particle_block_[particle];
  }
  [[nodiscard]] const std::vector<std::uint32_t>& block_particles(std::size_t b) const {
    return block_particles_[b];
  }
  /// On a regular lattice: a neighbour along an axis is missing. Otherwise always.
  [[nodiscard]] bool is_surface(std::uint32_t particle) const { return surface_[particle] != 0; }

  /// From a particle's centre at rest to the body's face in a direction, and how that changes with
  /// the direction.
  struct Reach {
    double distance = 0.0;        ///< [m]
    Vec3d slope = Vec3d::Zero();  ///< ∂distance/∂direction [m], world axes
  };
  /// In the unit `direction` (world axes at rest): as far as the planes of Body::skin that face it
  /// lie, and to the face of the particle's box where none does. A face that is tilted to a
  /// collider is met at the middle of its tile, whose gap is the mean of the tile's.
  [[nodiscard]] Reach reach(std::uint32_t particle, const Vec3d& direction) const;

  /// Unit, outward, body axes: against the gradient of the lumped mass.
  [[nodiscard]] Vec3d outward_normal(std::uint32_t particle) const;
  /// How quickly the body's skin gives way to a contact: with springs k A [N/m] on the faces of its
  /// outermost particles, no frequency exceeds ω² = k · this [m²/kg]: twice the largest eigenvalue
  /// of M⁻¹ Wᵀ A W over six directions of contact, since the mass matrix leaves at least half of
  /// the lumped masses (TotalBody::correct_lumping).
  [[nodiscard]] double contact_response() const;
  [[nodiscard]] const std::vector<std::uint32_t>& slab_chunks() const { return slab_chunks_; }
  /// Flat [8] a block, as TotalView::block_nodes.
  [[nodiscard]] const std::uint32_t* block_nodes() const { return block_nodes_.front().data(); }
  /// Blocks at (−a, −b, −c) of a node block, index 4a+2b+c; kNoBlock where there is none.
  [[nodiscard]] const std::array<std::uint32_t, 8>& node_sources(std::size_t node_block) const {
    return node_sources_[node_block];
  }
  /// Σ m w over the quadrature points [kg], node blocks × 64.
  [[nodiscard]] const std::vector<double>& lumped_mass() const { return lumped_mass_; }
  /// Masses of the nodes [kg]: lumped, and raised where the body hardly reaches.
  [[nodiscard]] const std::vector<double>& mass() const { return mass_; }
  [[nodiscard]] const std::vector<double>& inverse_mass() const { return inverse_mass_; }
  [[nodiscard]] double total_mass() const { return total_mass_; }
  [[nodiscard]] const Vec3d& center_of_mass() const { return center_; }  ///< local, at rest

  [[nodiscard]] Vec3d node_position(std::uint32_t node) const;  ///< local, at rest
  /// Integer coordinates of a node.
  [[nodiscard]] Vec3i node_coordinates(std::uint32_t node) const;
  /// The node with these coordinates, or kNoBlock.
  [[nodiscard]] std::uint32_t find_node(const Vec3i& coordinates) const;
  /// The block of cells at these coordinates (of cells / 4, rounded down), or kNoBlock.
  [[nodiscard]] std::uint32_t find_block(const Vec3i& coordinates) const;
  /// The node at `place`, each 0…5, of what a block of cells touches; the block is one that is
  /// there.
  [[nodiscard]] std::uint32_t node_of_block(std::uint32_t block, const Vec3i& place) const;
  /// Node coordinate (real-valued) of a local position along an axis: an integer is on a node.
  [[nodiscard]] double node_coordinate(const Vec3d& local, int axis) const {
    return local[axis] / dx_ - phase_[axis];
  }
  /// Base node's coordinates of the cell that holds a point, and x/dx − base there.
  [[nodiscard]] std::pair<Vec3i, Vec3d> cell(const Vec3d& local) const;
  /// A particle, in the cell whose polynomial moves it.
  [[nodiscard]] CellPoint point_of(std::uint32_t particle) const;
  /// A point of its box.
  [[nodiscard]] CellPoint point_in(std::uint32_t particle, const Vec3d& local) const;

  /// First-order (moving least squares) weights over nodes that carry mass: exact for affine
  /// motion, also for points off the body, where plain B-spline weights would lean on empty nodes.
  [[nodiscard]] NodeWeights point_weights(const Vec3d& local) const;

  /// The body's own field at a point in a particle's box or close to it; off the body, the
  /// polynomial of the particle's cell goes on, whose nodes all carry mass. What is zero under
  /// these weights is held exactly.
  [[nodiscard]] NodeWeights field_weights(std::uint32_t particle, const Vec3d& local) const;

 private:
  [[nodiscard]] CellPoint point_in_cell(std::uint32_t block, const Vec3i& cell,
                                        const Vec3d& local) const;
  void place_points();
  void link_blocks();
  void find_surface(const Lattice& lattice);
  void index_skin(const std::vector<SkinPlane>& skin);
  void lump_mass(double density);
  void raise_light_nodes(double density);

  double dx_;
  Mat3d axes_;
  Vec3d origin_;
  Vec3d phase_;
  Points rest_;
  std::vector<double> volumes_;
  Quadrature quadrature_;
  std::vector<std::uint32_t> place_;
  std::vector<std::uint32_t> particle_block_;
  std::vector<std::uint8_t> surface_;
  std::vector<SkinPlane> skin_;
  std::vector<std::uint32_t> skin_first_;      ///< of a particle's planes; one more at the end
  std::vector<Vec3i> block_coordinates_;       ///< sorted
  std::vector<Vec3i> node_block_coordinates_;  ///< sorted
  std::vector<std::uint32_t> slab_chunks_;
  std::vector<std::vector<std::uint32_t>> block_particles_;
  std::vector<std::array<std::uint32_t, 8>> block_nodes_;
  std::vector<std::array<std::uint32_t, 8>> node_sources_;
  std::vector<double> lumped_mass_;
  std::vector<double> mass_;
  std::vector<double> inverse_mass_;
  double total_mass_ = 0.0;
  Vec3d center_ = Vec3d::Zero();
};

/// The 27 nodes of a cell that holds quadrature points, 9i + 3j + k; looked up where the cell is
/// another than last time.
class NodesOfCell {
 public:
  explicit NodesOfCell(const TotalGrid& grid) : grid_(grid) {}
  const std::array<std::uint32_t, 27>& operator()(const Vec3i& cell);

 private:
  const TotalGrid& grid_;
  Vec3i cell_ = Vec3i::Constant(std::numeric_limits<int>::min());
  Vec3i at_ = cell_;  ///< of the block
  std::uint32_t block_ = kNoBlock;
  std::array<std::uint32_t, 27> nodes_{};
};

}  // namespace matterfit::mpm
