// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mpm/scene.hpp"
#include "mpm/spline_weights.hpp"

namespace matterfit::mpm {

/// Derivatives with respect to how a body starts whose particles carry its state.
struct StartCotangents {
  Points positions;  ///< of Body::rest, each; without what attached masses are shared out by
  Vec3d offset = Vec3d::Zero();    ///< of all of them together, with the pins
  Vec3d rotation = Vec3d::Zero();  ///< of them about their centre, with the pins and their motion
  Vec3d velocity = Vec3d::Zero();
  Vec3d spin = Vec3d::Zero();
  std::vector<Vec3d> particle_velocities;
  double log_density = 0.0;  ///< ∂/∂ln ρ, of the whole run
};

/// What a particle's transfer to the grid gives back: momentum Σ w m (v + C (x_I − x)) and mass.
struct TransferCotangents {
  Vec3d x = Vec3d::Zero();
  Vec3d v = Vec3d::Zero();
  Mat3d affine = Mat3d::Zero();  ///< of C
  double log_density = 0.0;

  /// Adds what comes back from node (i, j, k) of the stencil of a particle at `f` in its cell, by
  /// the cotangents of the node's momentum and mass.
  void add_node(const PointStencil& stencil, const Vec3d& f, double dx, std::size_t i,
                std::size_t j, std::size_t k, double mass, const Vec3d& velocity,
                const Mat3d& of_affine, const Vec3d& momentum_bar, double mass_bar);
};

/// Adds to `out` what the first transfers of the body's particles, one each, give back.
void add_first_transfers(const Body& body, const std::vector<TransferCotangents>& particles,
                         StartCotangents& out);

}  // namespace matterfit::mpm
