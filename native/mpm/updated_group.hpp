// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "mpm/kernels.hpp"
#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"
#include "mpm/state_bytes.hpp"

namespace matterfit::mpm {

/// One particle of an updated Lagrangian body, for contact with bodies of the other formulation.
/// Valid until the next step.
struct UpdatedPoint {
  std::uint32_t block, member, slab, chunk, lane;
  std::uint32_t body;  ///< into scene.bodies
  std::uint32_t id;    ///< particle of the body
  Vec3d position = Vec3d::Zero();
  Vec3d velocity = Vec3d::Zero();
  double volume = 0.0;  ///< at rest [m³]
  double mass = 0.0;
};

/// The bodies in the updated Lagrangian formulation (MLS-MPM with APIC, Hu et al. 2018, Jiang et
/// al. 2015), on one sparse grid that they share, which is how they touch each other.
class UpdatedGroup {
 public:
  UpdatedGroup(const Scene& scene, const std::vector<std::size_t>& bodies,
               const Kernels<float>& kernels, std::size_t memory_limit);
  ~UpdatedGroup();
  UpdatedGroup(const UpdatedGroup&) = delete;
  UpdatedGroup& operator=(const UpdatedGroup&) = delete;

  /// Tidies the grid; the largest stable substep at the present state [s] and what sets it.
  [[nodiscard]] std::pair<double, std::string> begin_frame(double time);
  /// One substep from `time`. Returns the smallest and largest J. Throws Error(kCompute) for a NaN,
  /// an inverted element, or a particle that leaves the domain or its grid.
  std::pair<double, double> step(Arena& arena, double time, double dt, const Vec3d& gravity);
  /// Particles inside a box, in storage order.
  void collect(const Vec3d& low, const Vec3d& high, std::vector<UpdatedPoint>& out) const;
  /// Adds an impulse [N s] to what the grid takes up in the next step.
  void add_impulse(const UpdatedPoint& point, const Vec3d& impulse);
  /// Of any particle in the last substep [m/s].
  [[nodiscard]] double max_speed() const;

  void sample(std::vector<BodyState>& bodies) const;
  void report(FrameReport& report) const;
  void save(ByteWriter& out) const;
  void load(ByteReader& in);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace matterfit::mpm
