// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/collider_adjoint.hpp"

#include <gtest/gtest.h>

#include "shape/mesh_shapes_for_test.hpp"

namespace matterfit::shape {
namespace {

constexpr double kProbe = 1e-5;

/// What comes back to the place for the cotangent of the normal.
Vec3d of_normal(const Collider& collider, const Vec3d& x, const Vec3d& normal_bar) {
  ColliderCotangents bar;
  return back_to_surface(collider, x, 0.0, kProbe, collider.closest(x, 0.0), 0.0, normal_bar,
                         Vec3d::Zero(), bar);
}

// Inside a box the normal jumps where two faces are equally near; a hair beside that, the face that
// is met is as flat as ever.
TEST(ColliderAdjoint, AFaceIsFlatUpToItsEdge) {
  const Keyed<Pose> still{Pose{}};
  const ColliderPtr mesh = make_mesh_collider(
      "mesh", {}, test_shapes::box(Vec3f(-1.0F, -1.0F, -1.0F), Vec3f(1.0F, 1.0F, 1.0F)), still);
  const ColliderPtr box = make_box("box", {}, Vec3d::Ones(), still);
  for (const ColliderPtr& collider : {mesh, box}) {
    for (const double beside : {-0.3 * kProbe, 0.3 * kProbe}) {
      const Vec3d x(0.99, 0.2, 0.99 + beside);
      EXPECT_LT(of_normal(*collider, x, Vec3d(1.0, 0.3, -0.4)).norm(), 1e-6) << collider->name();
    }
  }
}

// (I − n nᵀ)/r around a sphere's centre.
TEST(ColliderAdjoint, ASphereIsRound) {
  const ColliderPtr sphere = make_sphere("sphere", {}, 0.5, Keyed<Pose>(Pose{}));
  const Vec3d x(0.3, -0.2, 0.5);
  const Vec3d bar(1.0, 0.3, -0.4);
  const Vec3d n = x.normalized();
  EXPECT_LT((of_normal(*sphere, x, bar) - (bar - n.dot(bar) * n) / x.norm()).norm(), 1e-8);
}

}  // namespace
}  // namespace matterfit::shape
