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
  void sample(std::vector<BodyState>& bodies) const;
  void report(FrameReport& report) const;
  void save(ByteWriter& out) const;
  void load(ByteReader& in);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace matterfit::mpm
