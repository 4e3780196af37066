// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "base/parallel.hpp"
#include "material/classical/law_gradient.hpp"
#include "mpm/body_terms.hpp"
#include "mpm/start_cotangents.hpp"
#include "mpm/updated_adjoint_kernels.hpp"
#include "mpm/updated_member.hpp"
#include "mpm/updated_record.hpp"
#include "shape/collider_adjoint.hpp"

namespace matterfit::mpm {

/// Derivatives of one number with respect to the state of one updated Lagrangian body and to what
/// it is made of.
template <class S>
struct UpdatedBodyCotangents {
  std::vector<UpdatedParticleBar<S>> particles;  ///< in the order of Body::rest
  std::vector<S> maxwell;                        ///< as UpdatedMember::maxwell
  std::vector<Vec3d> stretch;                    ///< of ContactMemory; empty without colliders
  Points rest;                                   ///< of Body::rest, through pins; sums
  Vec3d pivots = Vec3d::Zero();                  ///< of all pins' pivots together, sum
  /// Cotangent of all pins' turn with their motion about the world's origin, less what `rest` has
  /// of it.
  Vec3d turn = Vec3d::Zero();
  LawCotangents law;                              ///< sums over substeps
  std::vector<double> published;                  ///< of UpdatedMember::published, sums; or empty
  std::vector<material::MaxwellBranch> branches;  ///< by modulus and time, sums
  double log_density = 0.0;                       ///< ∂/∂ln ρ, sum
  TermCotangents terms;                           ///< sums
};

/// … of all bodies of a group, of its grid and of what acts on them.
template <class S>
struct UpdatedCotangents {
  std::vector<UpdatedBodyCotangents<S>> bodies;
  /// Cotangents of momentum (3) and mass at the nodes from which the next substep starts, per block
  /// [4][64]; empty at the end of a run.
  std::vector<S> nodes;
  std::shared_ptr<const UpdatedTopology> topology;  ///< of `nodes`
  Vec3d gravity = Vec3d::Zero();
  std::vector<shape::ColliderCotangents> colliders;  ///< in the order of Scene::colliders
};

/// The adjoint of UpdatedGroup's substep (MLS-MPM with APIC): particles to grid with the weights'
/// derivatives, grid with node-wise contact, grid to particles, every law with its history, contact
/// with colliders, and pins. Exact for the discrete scheme: what the forward pass computed is
/// differentiated, not the equation behind it. It goes by records and never transfers a particle to
/// the grid again. The same bits for any number of threads.
/// Limits: no impulses of total Lagrangian bodies (UpdatedGroup::add_impulse). A node-wise contact
/// has no derivative by where its surface is, only by how it is inclined and moves.
template <class S>
class UpdatedAdjoint {
 public:
  /// `bodies` as UpdatedGroup was given them; `rates`: GradientOptions::of_no_damping.
  UpdatedAdjoint(const Scene& scene, const std::vector<std::size_t>& bodies,
                 const UpdatedAdjointKernels<S>& kernels, bool rates = true);
  ~UpdatedAdjoint();
  UpdatedAdjoint(const UpdatedAdjoint&) = delete;
  UpdatedAdjoint& operator=(const UpdatedAdjoint&) = delete;

  /// `published`: also by the published law's weights, which costs about half as much again.
  [[nodiscard]] UpdatedCotangents<S> zero(bool published = false) const;
  /// Takes `bar` from after the substep to before it.
  void substep(Arena& arena, const UpdatedRecord<S>& record, UpdatedCotangents<S>& bar);
  /// The cotangents of the n-th body's start, with `bar` taken back to before the first substep.
  [[nodiscard]] StartCotangents start(Arena& arena, std::size_t body,
                                      const UpdatedCotangents<S>& bar) const;
  [[nodiscard]] material::MaterialGradient material_gradient(std::size_t body,
                                                             const UpdatedCotangents<S>& bar) const;
  /// Adds those by the effects' numbers and the material's correction (BodyTerms::add_to),
  /// `density_bar` that by the density.
  void add_terms(std::size_t body, const UpdatedCotangents<S>& bar, double density_bar,
                 std::vector<std::vector<double>>& effects,
                 material::MaterialGradient& material) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class UpdatedAdjoint<float>;
extern template class UpdatedAdjoint<double>;

}  // namespace matterfit::mpm
