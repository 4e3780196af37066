// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "shape/collider.hpp"
#include "shape/mesh_shapes_for_test.hpp"

/// Flat, round, cornered and moving colliders that can be moved by a little, for gradients against
/// differences.
namespace matterfit::shape::test_colliders {

/// Where the collider is besides its own motion, and how it touches.
struct Place {
  ContactKind kind = ContactKind::kFriction;
  ContactMethod method = ContactMethod::kParticle;
  double mu = 0.3;
  double stiffness = 5e6;
  Vec3d translation = Vec3d::Zero();
  Vec3d rotation = Vec3d::Zero();
};

enum class Shape { kPlane, kSphere, kBox, kCapsule, kMesh, kMovingPlane, kTurningBox, kMovingMesh };

inline ColliderPtr collider(Shape shape, const Place& place) {
  Contact contact;
  contact.kind = place.kind;
  contact.method = place.method;
  contact.mu = place.mu;
  contact.stiffness = place.stiffness;
  contact.damping = 0.1;
  const bool by_nodes = place.method == ContactMethod::kNode;
  const double angle = place.rotation.norm();
  const Quatd turn =
      angle > 0.0 ? Quatd(Eigen::AngleAxisd(angle, place.rotation / angle)) : Quatd::Identity();
  const auto moved = [&](const Vec3d& position, const Quatd& rotation) {
    return Pose{turn * position + place.translation, (turn * rotation).normalized()};
  };
  const Quatd own(Eigen::AngleAxisd(0.3, Vec3d(1, 1, 0).normalized()));
  switch (shape) {
    case Shape::kPlane:
      // Nodes lie on a plane through z = 0.02: whether they are inside would be chance.
      return make_plane("plane", contact,
                        turn * Vec3d(0, 0, by_nodes ? 0.0213 : 0.02) + place.translation,
                        turn * Vec3d(0.1, 0.05, 1.0).normalized());
    case Shape::kSphere:
      return make_sphere("sphere", contact, 0.3,
                         Keyed<Pose>(moved(Vec3d(0.06, 0.04, -0.28), Quatd::Identity())));
    case Shape::kBox:
      return make_box("box", contact, Vec3d(0.04, 0.2, 0.1),
                      Keyed<Pose>(moved(Vec3d(0.02, 0.05, -0.085), own)));
    case Shape::kCapsule:
      return make_capsule(
          "capsule", contact, 0.2, 0.05,
          Keyed<Pose>(moved(Vec3d(0.06, 0.04, -0.18),
                            Quatd(Eigen::AngleAxisd(1.4, Vec3d(1, 0.2, 0).normalized())))));
    case Shape::kMesh:
      return make_mesh_collider(
          "mesh", contact, test_shapes::box(Vec3f(-0.04F, -0.2F, -0.1F), Vec3f(0.04F, 0.2F, 0.1F)),
          Keyed<Pose>(moved(Vec3d(0.02, 0.05, -0.085), own)));
    case Shape::kMovingPlane:
    case Shape::kTurningBox:
    case Shape::kMovingMesh:
      break;
  }
  Keyed<Pose> motion;
  motion.times = {0.0, 0.02};
  const bool plane = shape == Shape::kMovingPlane;
  const Vec3d at = plane ? Vec3d(0, 0, 0.02) : Vec3d(0.05, 0.05, -0.08);
  motion.values = {moved(at, Quatd::Identity()),
                   moved(at + Vec3d(0.002, 0, 0.005), plane ? Quatd::Identity() : own)};
  if (plane) return make_plane("plane", contact, Vec3d::Zero(), Vec3d::UnitZ(), motion);
  if (shape == Shape::kMovingMesh) {
    return make_mesh_collider("mesh", contact,
                              test_shapes::box(Vec3f(-0.2F, -0.2F, -0.1F), Vec3f(0.2F, 0.2F, 0.1F)),
                              motion);
  }
  return make_box("box", contact, Vec3d(0.2, 0.2, 0.1), motion);
}

}  // namespace matterfit::shape::test_colliders
