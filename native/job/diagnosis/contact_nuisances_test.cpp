// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/contact_nuisances.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mpm/contact_law.hpp"
#include "mpm/default_stiffness.hpp"
#include "shape/collider.hpp"

namespace matterfit::job {
namespace {

/// A cube over a floor whose contact is the default and one whose contact is said.
mpm::Scene two_floors() {
  mpm::Scene scene;
  mpm::Body& body = scene.bodies.emplace_back();
  body.material.youngs_modulus = 1e5;
  body.material.poisson_ratio = 0.3;
  for (int i = 0; i < 8; ++i) {
    body.rest.push_back(0.2 * Vec3d(i & 1, (i >> 1) & 1, i >> 2));
    body.volumes.push_back(1e-3);
  }
  scene.colliders.push_back(shape::make_plane("floor", {}, Vec3d::Zero(), Vec3d::UnitZ()));
  shape::Contact said;
  said.mu = 0.7;
  said.stiffness = 2e6;
  said.damping = 0.2;
  scene.colliders.push_back(shape::make_plane("wall", said, Vec3d::Zero(), Vec3d::UnitX()));
  return scene;
}

TEST(OtherContacts, AreAsStiffAsAnotherSolverHasThem) {
  mpm::Scene scene = two_floors();
  const double usual = mpm::contact_stiffnesses(scene, scene.bodies.front()).front();
  ASSERT_GT(usual, 0.0);
  diagnose::Numerics numerics;
  numerics.contact_stiffness = 3.0;
  numerics.contact_damping = 0.1;
  struck_by_another_solver(numerics, scene);
  EXPECT_DOUBLE_EQ(scene.colliders[0]->contact().stiffness, 3.0 * usual);
  EXPECT_DOUBLE_EQ(scene.colliders[0]->contact().damping, mpm::kContactDamping + 0.1);
  EXPECT_DOUBLE_EQ(scene.colliders[1]->contact().stiffness, 6e6);
  EXPECT_DOUBLE_EQ(scene.colliders[1]->contact().damping, 0.2 + 0.1);
  EXPECT_DOUBLE_EQ(scene.colliders[1]->contact().mu, 0.7);
  EXPECT_EQ(scene.colliders[1]->name(), "wall");
  EXPECT_EQ(scene.bodies.front().material.damping_shear, 0.0);
  EXPECT_NEAR(scene.colliders[1]->closest(Vec3d(0.3, 0.0, 0.0), 0.0).distance, 0.3, 1e-12);
}

TEST(OtherContacts, LoseWhatTheyPassOn) {
  mpm::Scene scene = two_floors();
  diagnose::Numerics numerics;
  numerics.loss = 0.02;
  struck_by_another_solver(numerics, scene);
  const mpm::Body& body = scene.bodies.front();
  const double mu = 1e5 / 2.6;
  const double omega = std::numbers::pi * std::sqrt(mu / body.density) / 0.2;
  EXPECT_NEAR(body.material.damping_shear * omega / mu, 0.02, 1e-12);
}

TEST(OtherContacts, AreTheScenesOwnWhereNothingIsSaid) {
  mpm::Scene scene = two_floors();
  const std::vector<shape::ColliderPtr> before = scene.colliders;
  struck_by_another_solver({}, scene);
  EXPECT_EQ(scene.colliders, before);
}

}  // namespace
}  // namespace matterfit::job
