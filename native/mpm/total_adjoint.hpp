// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "material/classical/law_gradient.hpp"
#include "mpm/adjoint_kernels.hpp"
#include "mpm/total_body.hpp"

namespace matterfit::mpm {

/// Derivatives of one number with respect to a body's state and to what the body is made of.
template <class S>
struct TotalCotangents {
  TotalState<S> state;
  LawCotangents law;                             ///< sums over substeps
  std::vector<material::MaxwellBranch> maxwell;  ///< by modulus and time, sums
  Vec3d gravity = Vec3d::Zero();                 ///< world axes
  Vec3d gravity_turn = Vec3d::Zero();            ///< Σ g × ḡ
  double log_density = 0.0;                      ///< ∂/∂ln ρ
};

/// Derivatives with respect to the initial motion, world axes.
struct InitialCotangents {
  Vec3d velocity = Vec3d::Zero();
  Vec3d spin = Vec3d::Zero();
  std::vector<Vec3d> particle_velocities;
};

/// The adjoint of something that loads a body (TotalBody::add_load, set_node_forces).
template <class S>
class TotalLoadsAdjoint {
 public:
  TotalLoadsAdjoint() = default;
  virtual ~TotalLoadsAdjoint() = default;
  TotalLoadsAdjoint(const TotalLoadsAdjoint&) = delete;
  TotalLoadsAdjoint& operator=(const TotalLoadsAdjoint&) = delete;
  /// The body is at the state before the substep, its loads are cleared. `forces`: of nodes are
  /// asked for (by TotalNodeTerm::pushes), so that the load adds its own again.
  virtual void prepare(Arena& arena, const TotalSubstep& substep, bool forces) = 0;
  /// `force_bar`: cotangent of the node forces, per node block [3][64], body axes. Adds to `bar`.
  virtual void back(Arena& arena, const TotalSubstep& substep, const std::vector<double>& force_bar,
                    TotalCotangents<S>& bar) = 0;
};

/// The adjoint of TotalBody's substep: smoothing, kick and drift with pins and attached masses, and
/// the internal forces with every law's history. Exact for the discrete scheme: what the forward
/// pass computed is differentiated, not the equation behind it.
template <class S>
class TotalAdjoint {
 public:
  /// `body` is set to the states that are gone back over. `rates`: GradientOptions::of_no_damping.
  TotalAdjoint(TotalBody<S>& body, const material::Material& material,
               const AdjointKernels<S>& kernels, bool rates = true);

  [[nodiscard]] TotalCotangents<S> zero() const;
  /// Takes `bar` from after the substep to before it. `before` is the state before, `loads` are
  /// those of the forward pass, in its order.
  void substep(Arena& arena, const TotalSubstep& substep, const TotalState<S>& before,
               TotalCotangents<S>& bar, const std::vector<TotalLoadsAdjoint<S>*>& loads = {});
  /// Adds the cotangents of the particles' present positions, velocities and deformation gradients
  /// (world axes), one each or none.
  void add_particles(Arena& arena, const std::vector<Vec3d>& position_bar,
                     const std::vector<Vec3d>& velocity_bar,
                     const std::vector<Mat3d>& deformation_gradient_bar,
                     TotalCotangents<S>& bar) const;
  [[nodiscard]] InitialCotangents initial(const TotalCotangents<S>& bar) const;
  [[nodiscard]] material::MaterialGradient material_gradient(const TotalCotangents<S>& bar) const;

 private:
  void add_field(Arena& arena, const std::vector<Vec3d>& value_bar,
                 const std::vector<Mat3d>& gradient_bar, std::vector<double>& node_bar) const;
  void smooth(Arena& arena, double share, std::vector<double>& velocity_bar);
  [[nodiscard]] std::vector<Vec3d> deferred_accelerations(Arena& arena,
                                                          const TotalSubstep& substep);

  TotalBody<S>& body_;
  material::Material material_;
  const AdjointKernels<S>& kernels_;
  bool rates_;
  std::vector<S> displacement_halo_;
  std::vector<S> velocity_halo_;
  std::vector<double> node_field_;  ///< of a substep, as TotalState::velocity
  std::vector<LawCotangents> block_law_;
};

extern template class TotalAdjoint<float>;
extern template class TotalAdjoint<double>;

}  // namespace matterfit::mpm
