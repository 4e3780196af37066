// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "capture/mesh.hpp"
#include "mpm/scene.hpp"
#include "mpm/simulation.hpp"

/// Elastic bodies of any shape, thrown at random: what must run whatever the mesh.
namespace matterfit::bench {

/// A closed mesh about the origin, turned and scaled unevenly: blob, bevelled box, thin plate,
/// torus, cross or cylinder. The same for the same seed.
struct RandomMesh {
  capture::Mesh mesh;
  std::string shape;
};
[[nodiscard]] RandomMesh random_mesh(std::uint64_t seed);

/// A body and what it is thrown at.
struct RandomThrow {
  mpm::Scene scene;
  std::string words;    ///< shape, material, motion and target, for a table
  double size = 0.0;    ///< of the ball of equal volume [m]
  double height = 0.0;  ///< up to which the centre of mass may rise by its energy [m]
};

/// What a throw may be.
struct ThrowSetting {
  double particles = 1500;  ///< about so many
  double seconds = 1.0;     ///< simulated
  mpm::Formulation formulation = mpm::Formulation::kAuto;
};

/// A body of random_mesh(seed) or of `mesh`, of a material in the range of the elastic presets (E
/// 1e5 to 2.64e5 Pa, ν .2 to .499), at up to 6 m/s with spin onto a floor, a ball that stands on
/// it, or into a corner of two walls.
[[nodiscard]] RandomThrow random_throw(std::uint64_t seed, const ThrowSetting& setting,
                                       const capture::Mesh* mesh = nullptr);

/// How a throw went.
struct ThrowResult {
  bool ran = false;
  std::string error;          ///< why not
  std::string notes;          ///< what the solver did to go on
  int frames = 0;             ///< that were simulated
  int retried = 0;            ///< of them with a shorter step than first chosen
  double highest = 0.0;       ///< of the centre of mass [m]
  double penetration = 0.0;   ///< deepest [m]
  double least_volume = 1.0;  ///< smallest det F
  double substeps = 0.0;      ///< of all frames
};

[[nodiscard]] ThrowResult run_throw(const RandomThrow& thrown, int threads);

/// None rises above what its energy allows, by a hundredth of its size; none is deeper in a
/// collider than a tenth of it.
[[nodiscard]] bool is_right(const RandomThrow& thrown, const ThrowResult& result);

}  // namespace matterfit::bench
