// SPDX-License-Identifier: GPL-3.0-or-later
// Cotangents of renewed bodies, and the way from those of a particle's motion to those of the nodes
// around it: shared by the adjoints of substeps, touches and renewals.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "material/classical/law_gradient.hpp"
#include "mpm/adjoint_kernels.hpp"
#include "mpm/body_terms.hpp"
#include "mpm/renewed_sample.hpp"
#include "mpm/renewed_state.hpp"
#include "shape/collider_adjoint.hpp"

namespace matterfit::mpm {

/// Derivatives of one number with respect to the state of one renewed body and to what it is made
/// of.
template <class S>
struct RenewedBodyCotangents {
  std::vector<S> place;                           ///< chunks × [3][16]: of x/dx − base
  std::vector<S> history;                         ///< as RenewedStore
  std::vector<S> maxwell;                         ///< chunks × branches × [6][16]
  std::vector<Vec3d> stretch;                     ///< of ContactMemory, by particle
  LawCotangents law;                              ///< sums over substeps
  std::vector<material::MaxwellBranch> branches;  ///< by modulus and time, sums
  double log_density = 0.0;                       ///< ∂/∂ln ρ, sum
  TermCotangents terms;                           ///< sums
};

/// Derivatives with respect to all bodies of a group, its nodes and what acts on them. Slots and
/// nodes are those of the reference that the state has.
template <class S>
struct RenewedCotangents {
  std::vector<RenewedBodyCotangents<S>> bodies;
  std::vector<double> displacement;  ///< node blocks × [3][64]
  std::vector<double> velocity;
  std::vector<double> mass;  ///< node blocks × [64]
  Vec3d gravity = Vec3d::Zero();
  std::vector<shape::ColliderCotangents> colliders;  ///< in the order of Scene::colliders
};

/// A particle's motion since the reference, from the nodes of its block; or cotangents of that.
struct RenewedMotion {
  Vec3d position = Vec3d::Zero();
  Vec3d velocity = Vec3d::Zero();
  Mat3d gradient = Mat3d::Zero();  ///< H = Σ u ⊗ ∇w
  Mat3d rate = Mat3d::Zero();      ///< Σ v ⊗ ∇w
};

/// Displacements and velocities of a block's nodes, and their cotangents.
class RenewedFields {
 public:
  RenewedFields(const RenewedGrid& grid, const Vec3i& coordinates, std::size_t member,
                std::size_t block, double dx, const std::vector<double>& displacement,
                const std::vector<double>& velocity)
      : nodes_(grid.nodes_of(member).data() + 8 * block),
        origin_(block_origin(coordinates, dx)),
        dx_(dx) {
    u_.gather(nodes_, displacement.data());
    v_.gather(nodes_, velocity.data());
    u_bar_.clear();
    v_bar_.clear();
  }

  template <class S>
  [[nodiscard]] RenewedMotion at(const UpdatedPlace<S>& place, const BlockField::Stencil& s) const {
    return {place.position(origin_, dx_) + u_.at(s), v_.at(s), u_.gradient(s), v_.gradient(s)};
  }
  /// Takes the cotangents of a particle's motion to the nodes. Returns that of its place [cells].
  Vec3d back(const BlockField::Stencil& s, const RenewedMotion& motion, const RenewedMotion& bar) {
    u_bar_.add(s, bar.position, bar.gradient);
    v_bar_.add(s, bar.velocity, bar.rate);
    return dx_ * (bar.position + motion.gradient.transpose() * bar.position +
                  motion.rate.transpose() * bar.velocity + u_.slope(s, bar.gradient) +
                  v_.slope(s, bar.rate));
  }
  /// Adds the cotangents of the nodes to fields of the grid.
  void add_to(std::vector<double>& displacement_bar, std::vector<double>& velocity_bar) const {
    for (std::size_t k = 0; k < 8; ++k) {
      u_bar_.add_to(k, displacement_bar.data() + nodes_[k] * kNodeBlock);
      v_bar_.add_to(k, velocity_bar.data() + nodes_[k] * kNodeBlock);
    }
  }
  [[nodiscard]] const std::uint32_t* nodes() const { return nodes_; }
  [[nodiscard]] double dx() const { return dx_; }

 private:
  const std::uint32_t* nodes_;
  Vec3d origin_;
  double dx_;
  BlockField u_;
  BlockField v_;
  BlockField u_bar_;
  BlockField v_bar_;
};

/// Adds to the cotangent of the history in `slot` what comes back from that of renewed_elastic().
template <class S>
void renewed_elastic_adjoint(const std::vector<S>& history, bool fluid, std::size_t slot,
                             const Mat3d& elastic_bar, std::vector<S>& history_bar) {
  const std::size_t kept = renewed_history(fluid);
  S* bar = history_bar.data() + slot / kLanes * (kept * kLanes) + slot % kLanes;
  if (fluid) {
    const double stretch = std::cbrt(1.0 + static_cast<double>(history[slot]));
    bar[0] += static_cast<S>(elastic_bar.trace() / (3.0 * stretch * stretch));
    return;
  }
  for (std::size_t i = 0; i < 9; ++i) {
    bar[i * kLanes] +=
        static_cast<S>(elastic_bar(static_cast<int>(i / 3), static_cast<int>(i % 3)));
  }
}

/// Adds to the cotangent of the place in `slot`.
template <class S>
void add_place_bar(std::size_t slot, const Vec3d& cells, std::vector<S>& place_bar) {
  S* bar = place_bar.data() + slot / kLanes * (3 * kLanes) + slot % kLanes;
  for (std::size_t a = 0; a < 3; ++a) {
    bar[a * kLanes] += static_cast<S>(cells[static_cast<int>(a)]);
  }
}

}  // namespace matterfit::mpm
