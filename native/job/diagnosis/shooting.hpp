// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "diagnose/observe.hpp"
#include "job/diagnosis/impacts.hpp"
#include "mpm/observed_frame.hpp"
#include "mpm/rigid_change.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// A frame in flight, just before an impact, at which a simulation takes up the rigid motion that
/// the recording shows there. What a solver gets wrong at one impact is then not multiplied at the
/// next: multiple shooting (Bock and Plitt 1984), with states taken from the tracks.
struct ShootingNode {
  std::size_t run = 0;
  std::size_t body = 0;                        ///< into Scene::bodies
  const diagnose::Capture* capture = nullptr;  ///< that shows it
  int frame = 0;                               ///< of the scene
  Eigen::Index first = 0;                      ///< frames of the capture, all in this flight
  Eigen::Index last = 0;                       ///< inclusive
};

/// One before each impact that a flight of at least four frames precedes, but for the first of a
/// body, whose throw is fitted. `impacts`: of one run, by time.
[[nodiscard]] std::vector<ShootingNode> shooting_nodes(const std::vector<Impact>& impacts,
                                                       const mpm::Scene& scene);

/// The frames of a body's flight before the first of its impacts; nothing where they are fewer than
/// four.
[[nodiscard]] std::optional<ShootingNode> first_flight(const Impact& first);

/// A rigid body's inertia about its centre, by volume.
struct Inertia {
  Vec3d center = Vec3d::Zero();      ///< [m]
  Mat3d moment = Mat3d::Identity();  ///< [m⁵]
};
[[nodiscard]] Inertia inertia_of(std::span<const Vec3d> places, std::span<const double> volumes);

/// Standard deviations of each component of a state that noise of the tracks gives.
struct StateNoise {
  double place = 0.0;     ///< [m]
  double turn = 0.0;      ///< [rad]
  double velocity = 0.0;  ///< [m/s]
  double spin = 0.0;      ///< [rad/s]
};

/// Where a body is and how it moves, as a rigid one.
struct RigidState {
  Vec3d place = Vec3d::Zero();         ///< of Inertia::center [m]
  Mat3d rotation = Mat3d::Identity();  ///< of the body at rest
  Vec3d velocity = Vec3d::Zero();      ///< [m/s]
  Vec3d spin = Vec3d::Zero();          ///< [rad/s]
  std::vector<std::size_t> tracks;     ///< that say so
  StateNoise noise;
};

/// Numbers of a state: place, turn, velocity, spin.
inline constexpr std::size_t kNumbersOfState = 12;

/// A state with errors added to it, each in its own unit, the turn about world axes.
[[nodiscard]] RigidState with_errors(RigidState state,
                                     const std::array<double, kNumbersOfState>& errors);

/// The state at scene time `time` [s] that the flight of a node shows: places of its frames by
/// Kabsch, their centres as a parabola, their turns as the free motion of a body of this inertia
/// (Gauss–Newton). `observations` of this capture are undone. Nothing where fewer than six tracks
/// are seen in all of its frames, they lie on a line, or a coordinate was not measured.
[[nodiscard]] std::optional<RigidState> flight_state(
    const ShootingNode& node, const Inertia& inertia, double time,
    std::span<const diagnose::Observed> observations);

/// What takes a simulated body to a state. `seen`: positions of all of the capture's tracks in the
/// simulation; `volumes` of its particles, whose positions and velocities `frame` has.
[[nodiscard]] mpm::RigidChange change_to(const RigidState& state, const ShootingNode& node,
                                         const Inertia& inertia, const Points& seen,
                                         std::span<const double> volumes,
                                         const mpm::ObservedFrame::Body& frame);

}  // namespace matterfit::job
