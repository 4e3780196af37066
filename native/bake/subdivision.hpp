// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "capture/binding.hpp"
#include "capture/mesh.hpp"

namespace matterfit::bake {

struct CageOptions {
  bool keep_corners = false;  ///< Blender's subdivision modifier: Boundary Smooth = Keep Corners
  capture::BindingOptions binding;
};

/// Binds a render mesh that has a subdivision modifier. A point cache plays on the base mesh,
/// before that modifier, so what moves are the cage's vertices c; what must follow the particles is
/// the limit surface that is seen. Let L be OpenSubdiv's limit stencils at the cage's vertices, so
/// that L c are their places on the limit surface. These are bound at rest, t(t) = where the
/// particles take them, and each frame solves
///
///   min |L c − t|² + ε² |c − g|²
///
/// by sparse LDLᵀ, twice over with the first answer as g (iterated Tikhonov), where g is the cage
/// bound directly. The guess is needed because L can be singular (the cube's cage: pushing its
/// corners in and out alternately does not move their limit points) and because it makes affine
/// motions exact. ε = 0.03: what the particles ask for is met to 10⁻⁴ where L's singular values are
/// above 1/9, those of a regular grid.
class CageBinding {
 public:
  /// `cage` and `rest` in the frame of the body at rest [m]. Throws Error(kInput) for a cage that
  /// OpenSubdiv cannot take, or as MeshBinding does.
  CageBinding(const capture::Mesh& cage, std::span<const Vec3d> rest, double separation,
              const CageOptions& options, Arena& arena);
  ~CageBinding();
  CageBinding(CageBinding&&) noexcept;
  CageBinding& operator=(CageBinding&&) noexcept;

  /// Positions of the cage's vertices [m], world.
  [[nodiscard]] std::vector<Vec3d> cage_positions(const capture::ParticleView& state,
                                                  Arena& arena) const;
  /// L c: the limit points of the cage's vertices at `cage_positions`.
  [[nodiscard]] std::vector<Vec3d> limit_positions(std::span<const Vec3d> cage_positions) const;
  /// The limit point that is farthest from its nearest particle.
  [[nodiscard]] capture::MeshBinding::Farthest farthest() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace matterfit::bake
