// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "effects/effect.hpp"
#include "material/material.hpp"
#include "shape/collider.hpp"
#include "shape/keyed.hpp"

namespace matterfit::mpm {

enum class Formulation {
  kAuto,     ///< total for elastic laws, updated for the rest
  kTotal,    ///< total Lagrangian: grid of the rest shape, node velocities the state
  kUpdated,  ///< updated Lagrangian MLS-MPM with APIC
  kRenewed,  ///< node velocities the state as in total, its reference renewed as motion asks
};

/// Where a body's particles lie: x = origin + axes · (spacing · (i + ½, j + ½, k + ½)) for integer
/// i, j, k where `regular`. A total Lagrangian grid takes these axes, so particles keep their place
/// in the cell. The lattice of jittered or imported particles is not regular; axes and origin still
/// orient the grid.
struct Lattice {
  Vec3d origin = Vec3d::Zero();
  Quatd axes = Quatd::Identity();
  double spacing = 0.0;
  bool regular = false;
};

/// A plane that bounds the body's shape at rest where a particle is near the surface.
struct SkinPlane {
  std::uint32_t particle = 0;
  Vec3d normal = Vec3d::UnitZ();  ///< unit, outward, world axes at rest
  double depth = 0.0;             ///< of the particle's centre below the plane [m]
};

/// A region of the body at rest whose motion is prescribed.
struct Pin {
  enum class Region {
    kAll,     ///< the whole body
    kPlane,   ///< everything on the plane or behind it (opposite to its normal)
    kBox,     ///< axis-aligned, `low` to `high`
    kSphere,  ///< `point`, `radius`
    kPoints,  ///< material within `radius` of any of `points`
  };
  Region region = Region::kAll;
  Vec3d point = Vec3d::Zero();
  Vec3d normal = Vec3d::UnitZ();
  Vec3d low = Vec3d::Zero();
  Vec3d high = Vec3d::Zero();
  double radius = 0.0;
  Points points;
  /// Motion relative to the rest position (identity: held still). The pose's origin is `pivot`.
  shape::Keyed<shape::Pose> motion = shape::Keyed<shape::Pose>(shape::Pose{});
  Vec3d pivot = Vec3d::Zero();
  /// Seconds after the scene's first frame from which the pin no longer holds.
  double release = std::numeric_limits<double>::infinity();
};

/// A point mass that moves with the body: inertia and weight [kg] at rest position `position`.
struct AttachedMass {
  Vec3d position = Vec3d::Zero();
  double mass = 0.0;
  double attach = 0.0;  ///< seconds after the scene's first frame from which it is there
};

struct Body {
  std::string name;
  material::Material material;
  double density = 1000.0;  ///< at rest [kg/m³]
  Formulation formulation = Formulation::kAuto;
  Points rest;                  ///< particle positions at rest, where the body starts (world)
  std::vector<double> volumes;  ///< rest volume of each particle [m³]
  Lattice lattice;
  /// Planes of the shape that was filled, by particle, ascending: contact meets these, and the
  /// faces of the particles' boxes where there are none.
  std::vector<SkinPlane> skin;
  Vec3d velocity = Vec3d::Zero();  ///< initial, of the centre of mass [m/s]
  Vec3d spin = Vec3d::Zero();      ///< initial, world axes through the centre of mass [rad/s]
  std::vector<Vec3d> particle_velocities;  ///< optional, added to the rigid motion, one each
  /// For a body that is taken over in motion, in the updated formulation: F of each particle, and
  /// ∇v [1/s] in place of that of `spin`. Empty: at rest, `rest` is where it has no stress.
  std::vector<Mat3d> deformation_gradients;
  std::vector<Mat3d> velocity_gradients;
  std::vector<Pin> pins;
  std::vector<AttachedMass> masses;
};

/// A change of a total Lagrangian body's rigid motion when a frame begins: what something that is
/// not in the scene did to it.
struct Nudge {
  std::size_t body = 0;            ///< into Scene::bodies
  int frame = 0;                   ///< the one that begins
  Vec3d velocity = Vec3d::Zero();  ///< added to that of the centre of mass [m/s]
  Vec3d spin = Vec3d::Zero();      ///< added, world axes through the centre of mass [rad/s]
};

/// Contact between two different bodies.
struct BodyContact {
  std::string first;
  std::string second;
  shape::Contact contact;
};

/// Closed walls of the domain, seen from inside; a particle beyond them is an error.
struct Walls {
  Vec3d low = Vec3d::Constant(-std::numeric_limits<double>::infinity());
  Vec3d high = Vec3d::Constant(std::numeric_limits<double>::infinity());
  shape::Contact contact;
};

struct Scene {
  double fps = 24.0;
  int first_frame = 0;
  int end_frame = 1;  ///< half-open
  double dx = 0.02;   ///< grid spacing, twice the particle separation [m]
  shape::Keyed<Vec3d> gravity = shape::Keyed<Vec3d>(Vec3d(0, 0, -9.81));
  std::vector<Body> bodies;
  std::vector<shape::ColliderPtr> colliders;
  std::vector<BodyContact> contacts;
  std::optional<Walls> walls;
  std::vector<effects::Effect> effects;  ///< what the model is extended by
  std::vector<Nudge> nudges;
  double cfl = 0.4;        ///< largest motion in one substep, in cells
  double dt = 0.0;         ///< overrides the solver's substep where > 0 [s]
  double dt_safety = 0.8;  ///< fraction of the stability limit that is used
  /// How many substeps each frame takes, in place of the solver's choice, so that runs beside each
  /// other take the same ones; 0, or past the end: the solver chooses. A frame that fails is not
  /// tried again with more.
  std::vector<int> substeps;
  /// FrameSchedule::renewals of each frame that `substeps` has; past the end: none are given.
  std::vector<std::vector<double>> renewals;
  /// Moves the total Lagrangian grid inside each body by this fraction of a cell (tests of
  /// accuracy below the cell).
  Vec3d grid_shift = Vec3d::Zero();
};

}  // namespace matterfit::mpm
