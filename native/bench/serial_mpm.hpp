// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace matterfit::bench {

/// The yardstick: MLS-MPM with APIC transfers as one writes it down from the papers, in plain
/// serial C++: an array of particle structs, a dense grid, fixed corotated elasticity, quadratic
/// B-splines, 3D, float. Nothing is sorted, blocked or vectorised by hand; particles lie in lattice
/// order, which is kind to its caches. Compiled with -O3 -march=native.
///
/// Hu et al. 2018, "A Moving Least Squares Material Point Method", eq. 16–18; fixed corotated:
/// Stomakhin et al. 2012, P = 2μ(F − R) + λ(J − 1)J F⁻ᵀ.
class SerialMpm {
 public:
  struct Particle {
    std::array<float, 3> x;
    std::array<float, 3> v;
    std::array<float, 9> C;  ///< affine velocity, row-major [1/s]
    std::array<float, 9> F;  ///< deformation gradient, row-major
    float mass;
    float volume;  ///< at rest [m³]
  };

  struct Options {
    int grid = 64;           ///< nodes along each axis
    float dx = 0.02F;        ///< [m]
    float dt = 1e-4F;        ///< [s]
    float mu = 4e4F;         ///< [Pa]
    float lambda = 6e4F;     ///< [Pa]
    float gravity = -9.81F;  ///< along z [m/s²]
  };

  SerialMpm(std::vector<Particle> particles, const Options& options);

  void step();
  [[nodiscard]] const std::vector<Particle>& particles() const { return particles_; }

 private:
  struct Node {
    std::array<float, 3> v;
    float mass;
  };
  [[nodiscard]] std::size_t node_index(int i, int j, int k) const;
  void scatter();
  void update_grid();
  void gather();

  std::vector<Particle> particles_;
  Options options_;
  std::vector<Node> grid_;
};

}  // namespace matterfit::bench
