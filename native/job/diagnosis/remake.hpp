// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// Another recording that could be made of a body, by what it changes in the scene of a present
/// one.
struct Remake {
  std::string name;
  std::string sentence;            ///< what to do, for people
  Vec3d velocity = Vec3d::Zero();  ///< added to the throw [m/s]
  Vec3d spin = Vec3d::Zero();      ///< added to it [rad/s]
  double higher = 0.0;             ///< above the level grounds [m]
  Quatd turn = Quatd::Identity();  ///< of the body with what holds it, about its place
  double duration = 1.0;           ///< over that of the present one
};

/// Recordings of a body that could be made without other means: thrown otherwise where it flies,
/// from higher where nothing but level grounds (`grounds`: their names) is there to meet, turned on
/// its side where it is held, longer.
[[nodiscard]] std::vector<Remake> remakes_of(const mpm::Scene& scene, std::size_t body,
                                             const std::vector<std::string>& grounds);

/// Makes the scene of a recording that of another; after everything else that changes it.
void remake(const Remake& other, std::size_t body, mpm::Scene& scene);

}  // namespace matterfit::job
