// SPDX-License-Identifier: GPL-3.0-or-later
// What changes the motion of a total Lagrangian body's nodes: pins and attached masses.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "base/vec.hpp"
#include "mpm/scene.hpp"
#include "mpm/total_grid.hpp"

namespace matterfit::mpm {

/// The part of a substep in which nodes move, body axes.
struct NodeMoment {
  double kick = 0.0;  ///< of accelerations [s]
  double dt = 0.0;    ///< of velocities [s]
  double time = 0.0;  ///< of the state before [s]
  Vec3d gravity = Vec3d::Zero();
};

/// Sorted nodes, each with a place in a list.
class NodeList {
 public:
  void add(std::vector<std::uint32_t> nodes);
  /// The place of a node that is in it.
  [[nodiscard]] std::size_t index(std::uint32_t node) const {
    return places_[node - nodes_.front()];
  }
  [[nodiscard]] const std::vector<std::uint32_t>& nodes() const { return nodes_; }
  [[nodiscard]] std::size_t size() const { return nodes_.size(); }

 private:
  std::vector<std::uint32_t> nodes_;
  std::vector<std::uint32_t> places_;  ///< of the nodes from the first to the last
};

/// A substep of the nodes that terms act on, in the order of NodeList, body axes.
struct NodeMotion {
  const NodeList& list;
  std::vector<Vec3d> acceleration;              ///< f/m + g [m/s²]
  std::vector<Vec3d> velocity;                  ///< at its end [m/s]
  const std::vector<double>& displacement_was;  ///< at its start, fields of all nodes [m]
  const std::vector<double>& velocity_was;      ///< [m/s]
};

/// Cotangents of a NodeMotion.
struct NodeMotionBar {
  const NodeList& list;
  std::vector<Vec3d> acceleration;
  std::vector<Vec3d> velocity;
  std::vector<Vec3d> displacement_was;
  std::vector<Vec3d> velocity_was;
  Vec3d gravity = Vec3d::Zero();
  double log_density = 0.0;  ///< of the nodes' masses, at given accelerations
};

/// A term has the functions of each place where it acts, with their transposes: what they do is
/// affine in accelerations, velocities and displacements. First all terms push(), then velocities
/// are kicked, then all terms that are in force move() them.
class TotalNodeTerm {
 public:
  TotalNodeTerm() = default;
  virtual ~TotalNodeTerm() = default;
  TotalNodeTerm(const TotalNodeTerm&) = delete;
  TotalNodeTerm& operator=(const TotalNodeTerm&) = delete;

  /// Those that it looks at or changes, in any order.
  [[nodiscard]] virtual std::vector<std::uint32_t> nodes() const = 0;
  /// The term is there before this time [s].
  [[nodiscard]] virtual double release() const { return std::numeric_limits<double>::infinity(); }
  /// It prescribes the motion of every node that has mass.
  [[nodiscard]] virtual bool holds_all() const { return false; }

  /// Changes accelerations.
  virtual void push(const NodeMoment& /*moment*/, NodeMotion& /*motion*/) const {}
  /// push_adjoint() asks for the accelerations before push().
  [[nodiscard]] virtual bool pushes() const { return false; }
  virtual void push_adjoint(const NodeMoment& /*moment*/,
                            const std::vector<Vec3d>& /*acceleration*/,
                            NodeMotionBar& /*bar*/) const {}

  /// Changes velocities.
  virtual void move(const NodeMoment& /*moment*/, NodeMotion& /*motion*/) const {}
  virtual void move_adjoint(const NodeMoment& /*moment*/, NodeMotionBar& /*bar*/) const {}
};

/// The terms of one body in the order in which they act. Nodes that none looks at are free, and no
/// term is called for them; a body without terms calls none.
class TotalNodeTerms {
 public:
  /// Throws Error(kInput) for a pin that holds nothing.
  TotalNodeTerms(const Body& body, const TotalGrid& grid);

  [[nodiscard]] bool any() const { return list_.size() > 0; }
  /// Marks of nodes that step() moves, a byte a node.
  [[nodiscard]] const std::vector<std::uint8_t>& deferred() const { return deferred_; }
  [[nodiscard]] const std::vector<std::uint32_t>& deferred_nodes() const { return list_.nodes(); }
  /// step_adjoint() asks for accelerations.
  [[nodiscard]] bool pushes() const;
  [[nodiscard]] bool held(double time) const;
  [[nodiscard]] bool releases_between(double from, double to) const;

  /// Moves the deferred nodes by a substep. `acceleration`: f/m + g of each of them.
  void step(const NodeMoment& moment, std::vector<Vec3d> acceleration,
            std::vector<double>& displacement, std::vector<double>& velocity) const;
  /// The transpose of step(). The fields hold the cotangents of the state after, and get those of
  /// the state before, at deferred nodes. Returns the other ones; `acceleration` as in step(), read
  /// if pushes().
  [[nodiscard]] NodeMotionBar step_adjoint(const NodeMoment& moment,
                                           const std::vector<Vec3d>& acceleration,
                                           std::vector<double>& displacement_bar,
                                           std::vector<double>& velocity_bar) const;

 private:
  std::vector<std::unique_ptr<TotalNodeTerm>> terms_;
  NodeList list_;
  std::vector<std::uint8_t> deferred_;
};

}  // namespace matterfit::mpm
