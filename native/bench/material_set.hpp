// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "bench/reference_law.hpp"

namespace matterfit::bench {

inline constexpr int kSetFramesPerSecond = 24;
inline constexpr int kSetFrames = 16;
/// The first of them are for the fit, the rest is for the prediction.
inline constexpr int kSetFittedFrames = 12;

/// One thrown body of the set.
struct SetClip {
  std::string name;  ///< LAW_SHAPE, as "elastic_torus"
  std::string shape;
  ReferenceMaterial material;
  double volume = 0.0;  ///< [m³]
  Quatd turn = Quatd::Identity();
  double clearance = 0.0;          ///< of the lowest point above the ground [m]
  Vec3d velocity = Vec3d::Zero();  ///< [m/s]
  Vec3d spin = Vec3d::Zero();      ///< [rad/s]
  std::uint64_t seed = 0;
};

/// The 45 clips: ten shapes of each of four materials, five of sand, as in PAC-NeRF (Li et al.
/// 2023), with parameters drawn around its published scenes and NCLaw's (Ma et al. 2023). Always
/// the same.
[[nodiscard]] std::vector<SetClip> material_set();

/// Sequences of each object of object_set().
inline constexpr std::size_t kObjectSequences = 4;
/// An egg (neo-Hookean), bread (a box, von Mises), cream (an ellipsoid, Newtonian), a pawn
/// (Drucker–Prager) and a rubber (a capsule, of a law that the solver does not have), each thrown
/// four times, turned at random, with another velocity and spin: egg_1 … rubber_4. Always the same.
/// After MASIV (Table 7), whose objects are not published.
[[nodiscard]] std::vector<SetClip> object_set();

}  // namespace matterfit::bench
