// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "mpm/kernels.hpp"
#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"
#include "mpm/state_bytes.hpp"
#include "mpm/updated_particles.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

/// The bodies in the updated Lagrangian formulation (MLS-MPM with APIC, Hu et al. 2018, Jiang et
/// al. 2015), on one sparse grid that they share, which is how they touch each other. S is the
/// scalar of grid and particles.
template <class S>
class UpdatedGroup final : public ParticleBodies<S> {
 public:
  UpdatedGroup(const Scene& scene, const std::vector<std::size_t>& bodies,
               const Kernels<S>& kernels, std::size_t memory_limit,
               const Interrupter* interrupter = nullptr);
  ~UpdatedGroup() override;

  /// Tidies the grid; the largest stable substep at the present state [s] and what sets it.
  [[nodiscard]] std::pair<double, std::string> begin_frame(double time);
  /// One substep from `time`. Returns the smallest and largest J. Throws Error(kCompute) for a NaN,
  /// an inverted element, or a particle that leaves the domain or its grid. `record` gets what the
  /// adjoint needs, if not null.
  std::pair<double, double> step(Arena& arena, double time, double dt, const Vec3d& gravity,
                                 UpdatedRecord<S>* record = nullptr);
  void collect(const Vec3d& low, const Vec3d& high, std::vector<BodyPoint<S>>& out) const override;
  void push(const BodyPoint<S>& point, const Vec3d& force, double dt) override;
  [[nodiscard]] double term_acceleration() const override;
  [[nodiscard]] double max_speed() const override;

  /// Particles of the n-th of these bodies, in the order of Body::rest.
  [[nodiscard]] std::vector<UpdatedParticle> particles(std::size_t body) const;
  void sample(std::vector<BodyState>& bodies) const;
  void report(FrameReport& report) const;
  /// At the start of a frame.
  void save(ByteWriter& out) const;
  void load(ByteReader& in);
  /// Besides, between two substeps of one frame: how long contacts sleep.
  void save_sleep(ByteWriter& out) const;
  void load_sleep(ByteReader& in);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class UpdatedGroup<float>;
extern template class UpdatedGroup<double>;

}  // namespace matterfit::mpm
