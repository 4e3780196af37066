// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "mpm/observed_frame.hpp"
#include "mpm/particle_bodies.hpp"
#include "mpm/renewed_kernels.hpp"
#include "mpm/renewed_state.hpp"
#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"
#include "mpm/state_bytes.hpp"

namespace matterfit::mpm {

/// Bodies in the arbitrary updated Lagrangian formulation (Su et al. 2022): as in the total one
/// the velocities and displacements of nodes are the state,
///   f_I = −Σ V τ(Fᵉ) (I+H)⁻ᵀ ∇w_I,  v_I += kick (f_I/m_I + g),  u_I += dt v_I,
///   Fᵉ = (I + H) Fᵉ_ref,  H = Σ u_I ⊗ ∇w_I,
/// but the reference is renewed at times that motion sets: particles take place, velocity,
/// C = (Σ v_I ⊗ ∇w_I)(I + H)⁻¹ and Fᵉ from the nodes, a sparse grid is made around them in world
/// axes, and masses and momenta go to its nodes (APIC, Jiang et al. 2015). A transfer damps what
/// an affine velocity cannot carry; it is paid a few times a frame, whatever the substep. V is the
/// rest volume, τ per rest volume, so laws need nothing but Fᵉ.
///
/// All bodies share one grid, which is how they touch each other, and so are renewed together.
/// Times to look are the frame's: it is divided, by a power of two, so that at its fastest motion
/// nothing goes farther than half a cell from one to the next. Then the reference is renewed where
/// any particle is strained by more than a third since the last renewal, or has gone farther than a
/// third of a cell relative to the common motion; the second not where all there is is one elastic
/// body that no node-wise contact holds. So the schedule does not depend on the substep. A frame
/// that is given its renewals has others only where motion goes twice as far as that.
template <class S>
class RenewedGroup final : public ParticleBodies<S> {
 public:
  RenewedGroup(const Scene& scene, const std::vector<std::size_t>& bodies,
               const RenewedKernels<S>& kernels, std::size_t memory_limit);
  ~RenewedGroup() override;

  /// The largest stable substep at the present state [s] and what sets it.
  [[nodiscard]] std::pair<double, std::string> limit_step(double time) const;
  /// Substeps of the frame at `time`, `count` at least, so that every time to look is the end of
  /// one.
  [[nodiscard]] double whole_substeps(double time, double count) const;
  /// `renewals`: FrameSchedule's.
  void begin_frame(double time, int substeps,
                   const std::optional<std::vector<double>>& renewals = {});
  /// One substep from `time`. Returns the smallest and largest elastic J. Throws UnstableError for
  /// a NaN or an inverted element, Error(kCompute) where the grid outgrows the memory limit.
  std::pair<double, double> step(Arena& arena, double time, double dt, const Vec3d& gravity);

  void collect(const Vec3d& low, const Vec3d& high, std::vector<BodyPoint<S>>& out) const override;
  void push(const BodyPoint<S>& point, const Vec3d& force, double dt) override;
  [[nodiscard]] double max_speed() const override;
  [[nodiscard]] double term_acceleration() const override;

  void sample(Arena& arena, std::vector<BodyState>& bodies) const;
  /// The same without rounding.
  void observe(Arena& arena, bool deformation_gradients,
               std::vector<ObservedFrame::Body>& bodies) const;
  void report(FrameReport& report) const;
  /// Renewals since the start.
  [[nodiscard]] std::uint64_t renewals() const;
  /// Σ m v [kg m/s] and Σ m x × v [kg m²/s] of the nodes where they are now.
  [[nodiscard]] std::pair<Vec3d, Vec3d> momentum() const;
  /// Renews the reference now.
  void renew(Arena& arena);
  // What a way back needs.
  [[nodiscard]] RenewedState<S> record();
  void restore(const RenewedState<S>& state);
  /// From here on each substep fills it; null: none.
  void follow(RenewedSubstep* substep);
  /// From here on no substep renews the reference, and each puts here the velocities of nodes
  /// between its forces and contact by nodes; null: as ever.
  void look_into(std::vector<double>* pushed);

  /// At the start of a frame.
  void save(ByteWriter& out) const;
  void load(ByteReader& in);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class RenewedGroup<float>;
extern template class RenewedGroup<double>;

}  // namespace matterfit::mpm
