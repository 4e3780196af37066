// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "base/vec.hpp"

namespace matterfit::effects {

/// A share of a body's material and its motion between two substeps, world axes. The solver decides
/// which shares there are: their volumes add up to the body's, and a force per mass that is the
/// same for all of them accelerates every node by that.
struct MaterialPoint {
  std::uint32_t particle = 0;      ///< of the body, whose share it is, or the nearest one
  Vec3d rest = Vec3d::Zero();      ///< where it lies at rest [m]
  Vec3d position = Vec3d::Zero();  ///< [m]
  Vec3d velocity = Vec3d::Zero();  ///< [m/s]
  double volume = 0.0;             ///< at rest [m³]
  double mass = 0.0;               ///< [kg]
  /// World axes; the elastic part where the updated Lagrangian formulation flows. Only where a term
  /// has a stress.
  Mat3d deformation_gradient = Mat3d::Identity();
};

/// When a term acts, and what acts on everything then.
struct Moment {
  double time = 0.0;              ///< seconds after the scene's first frame
  Vec3d gravity = Vec3d::Zero();  ///< [m/s²]
};

/// Derivatives of one number by what a MaterialPoint and a Moment say.
struct MaterialPointBar {
  Vec3d position = Vec3d::Zero();
  Vec3d velocity = Vec3d::Zero();
  Vec3d rest = Vec3d::Zero();
  double mass = 0.0;
  Mat3d deformation_gradient = Mat3d::Zero();
  Vec3d gravity = Vec3d::Zero();
};

/// What a term may know of the body that it acts on, at rest.
struct BodyFacts {
  double volume = 0.0;           ///< [m³]
  double density = 0.0;          ///< [kg/m³]
  double gravity = 0.0;          ///< the largest [m/s²]
  Vec3d center = Vec3d::Zero();  ///< [m]
  double radius = 0.0;           ///< of the farthest particle from it [m]
};

/// An effect on one body, as the solver calls it: plain views in, forces and stresses out, so that
/// every formulation can call it. Immutable, and called by several threads at once. A term
/// overrides the pair of functions of each place where it acts. The integrator applies both like
/// gravity: evaluated at the positions before a substep and the velocities half a substep earlier,
/// times half of both substeps' lengths.
class Term {
 public:
  Term() = default;
  virtual ~Term() = default;
  Term(const Term&) = delete;
  Term& operator=(const Term&) = delete;

  /// The force on the point's material [N].
  [[nodiscard]] virtual Vec3d force(const MaterialPoint& /*point*/,
                                    const Moment& /*moment*/) const {
    return Vec3d::Zero();
  }
  /// The adjoint of force(): adds to `bar` and to `values`, one number for each of the effect's
  /// (Effect::values; of a keyed one the derivative by something added at all times).
  virtual void force_adjoint(const MaterialPoint& /*point*/, const Moment& /*moment*/,
                             const Vec3d& /*force_bar*/, MaterialPointBar& /*bar*/,
                             double* /*values*/) const {}
  /// The largest acceleration [m/s²] that the term gives to material at `speed` [m/s] or less, at
  /// any time: contact and the CFL limit look that far ahead.
  [[nodiscard]] virtual double acceleration_bound(double /*speed*/) const { return 0.0; }

  /// At most how fast it takes speed from material at `speed` [m/s] or less [1/s], |∂a/∂v|: an
  /// explicit substep that is longer than 1 over this turns the motion around.
  [[nodiscard]] virtual double rate_bound(double /*speed*/) const { return 0.0; }

  /// Whether it has a stress.
  [[nodiscard]] virtual bool has_stress() const { return false; }
  /// Kirchhoff stress [Pa], beside that of the body's law.
  [[nodiscard]] virtual Mat3d stress(const MaterialPoint& /*point*/,
                                     const Moment& /*moment*/) const {
    return Mat3d::Zero();
  }
  /// The adjoint of stress(), as force_adjoint().
  virtual void stress_adjoint(const MaterialPoint& /*point*/, const Moment& /*moment*/,
                              const Mat3d& /*stress_bar*/, MaterialPointBar& /*bar*/,
                              double* /*values*/) const {}
  /// How much it adds to the body's modulus λ + 2μ at most [Pa], 0 where it only takes away: the
  /// substep shrinks by that.
  [[nodiscard]] virtual double modulus_bound() const { return 0.0; }
};

}  // namespace matterfit::effects
