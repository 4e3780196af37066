// SPDX-License-Identifier: GPL-3.0-or-later
// The adjoint of what acts on updated Lagrangian bodies against central differences in double:
// contact of particles and of nodes with colliders, and pins.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "mpm/updated_contact.hpp"
#include "mpm/updated_rollout_for_test.hpp"
#include "shape/colliders_for_test.hpp"

namespace matterfit::mpm {
namespace {

using namespace shape::test_colliders;
using material::Law;
using material::Material;

constexpr double kLoadedH = 0.025;
constexpr double kLoadedScale = 0.1;

Material material_of(Law law) {
  Material m;
  m.law = law;
  m.youngs_modulus = 2e5;
  m.poisson_ratio = 0.35;
  m.yield_stress = 800.0;
  m.viscosity = law == Law::kNewtonian ? 5.0 : 20.0;
  m.bulk_modulus = 2e5;
  m.friction_angle = 30.0;
  m.cohesion = 500.0;
  return m;
}

Scene scene_of(Law law) {
  Scene scene;
  scene.fps = 100.0;
  scene.dx = 2.0 * kLoadedH;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(0, 0, -9.81));
  scene.bodies.push_back(
      updated_block_body(material_of(law), Vec3d(0.01, 0.005, 0.0225), 4, kLoadedH, 5));
  Body& body = scene.bodies[0];
  body.velocity = Vec3d(0.8, 0.3, -1.5);
  body.particle_velocities.clear();
  return scene;
}

/// What a scene with one collider takes, beside what every body has.
void expect_collider(UpdatedRollout& rollout, const UpdatedRollout::Gradient& g, Shape shape,
                     const Place& place, const std::string& name) {
  const shape::ColliderCotangents& found = g.colliders.back();
  const auto check = [&](double gradient, const std::string& what, double step, double factor,
                         const std::function<void(Place&, double)>& change) {
    rollout.expect(
        factor * gradient, kLoadedScale, name + ", " + what, step,
        [&](Scene& scene, double by) {
          Place moved = place;
          change(moved, by);
          scene.colliders.back() = collider(shape, moved);
        },
        factor);
  };
  if (place.method == shape::ContactMethod::kParticle) {
    check(found.stiffness, "stiffness", 1e-4 * place.stiffness, place.stiffness,
          [](Place& p, double by) { p.stiffness += by; });
  }
  if (place.kind == shape::ContactKind::kFriction) {
    check(found.mu, "mu", 1e-4, 1.0, [](Place& p, double by) { p.mu += by; });
  }
  for (int axis = 0; axis < 3; ++axis) {
    check(found.rotation[axis], "rotation", 1e-5, 0.1,
          [axis](Place& p, double by) { p.rotation[axis] += by; });
    // Nodes that come inside do so at once: there is no derivative by the distance.
    if (place.method == shape::ContactMethod::kNode) continue;
    check(found.translation[axis], "translation", 1e-6, 1e-2,
          [axis](Place& p, double by) { p.translation[axis] += by; });
  }
}

void expect_loaded_material(UpdatedRollout& rollout, const UpdatedRollout::Gradient& g,
                            const std::string& name) {
  const Material& m = rollout.scene.bodies[0].material;
  const bool fluid = m.law == Law::kNewtonian;
  const auto member = fluid ? &Material::viscosity : &Material::youngs_modulus;
  const double value = m.*member;
  rollout.expect(
      value * (fluid ? g.material[0].viscosity : g.material[0].youngs_modulus), kLoadedScale,
      name + ", material", 1e-4 * value,
      [&](Scene& scene, double by) { scene.bodies[0].material.*member += by; }, value);
}

struct LoadedCase {
  const char* name;
  Law law;
  Shape shape;
  shape::ContactKind kind;
  double mu;
};

TEST(UpdatedLoadsAdjoint, MatchesDifferencesForParticleContact) {
  const LoadedCase cases[] = {
      {"sliding", Law::kNeoHookean, Shape::kPlane, shape::ContactKind::kFriction, 0.2},
      {"sticking by friction", Law::kNeoHookean, Shape::kPlane, shape::ContactKind::kFriction, 5.0},
      {"glue", Law::kFixedCorotated, Shape::kPlane, shape::ContactKind::kGlue, 0.0},
      {"no slip", Law::kFixedCorotated, Shape::kPlane, shape::ContactKind::kNoSlip, 0.0},
      {"slip", Law::kStvkHencky, Shape::kPlane, shape::ContactKind::kSlip, 0.0},
      {"separating", Law::kNeoHookean, Shape::kPlane, shape::ContactKind::kSeparating, 0.0},
      {"plasticine on a sphere", Law::kVonMises, Shape::kSphere, shape::ContactKind::kFriction,
       0.3},
      {"sand on a plane", Law::kDruckerPrager, Shape::kPlane, shape::ContactKind::kFriction, 0.4},
      {"water that sticks", Law::kNewtonian, Shape::kPlane, shape::ContactKind::kGlue, 0.0},
      {"water with friction", Law::kNewtonian, Shape::kSphere, shape::ContactKind::kFriction, 0.3},
      {"cream with friction", Law::kHerschelBulkley, Shape::kPlane, shape::ContactKind::kFriction,
       0.3},
      {"edge of a box", Law::kNeoHookean, Shape::kBox, shape::ContactKind::kFriction, 0.3},
      {"moving plane", Law::kNewtonian, Shape::kMovingPlane, shape::ContactKind::kFriction, 0.3},
      {"turning box", Law::kNeoHookean, Shape::kTurningBox, shape::ContactKind::kGlue, 0.0},
      {"capsule", Law::kStvkHencky, Shape::kCapsule, shape::ContactKind::kFriction, 0.3},
      {"edge of a mesh", Law::kNeoHookean, Shape::kMesh, shape::ContactKind::kFriction, 0.3},
      {"sand on a moving mesh", Law::kDruckerPrager, Shape::kMovingMesh,
       shape::ContactKind::kFriction, 0.3},
  };
  for (const LoadedCase& item : cases) {
    Place place;
    place.kind = item.kind;
    place.mu = item.mu;
    UpdatedRollout rollout(scene_of(item.law));
    rollout.steps = 40;
    rollout.dt = 2e-4;
    rollout.scene.colliders.push_back(collider(item.shape, place));
    std::vector<UpdatedRecord<double>> records;
    (void)rollout.run<double>(&records);
    std::size_t touches = 0;
    for (const auto& record : records) touches += count_acts<UpdatedTouch<double>>(record);
    EXPECT_GT(touches, 100U) << item.name;
    const auto g = rollout.gradient<double>(records);
    rollout.expect_start(g, kLoadedScale, item.name);
    expect_loaded_material(rollout, g, item.name);
    expect_collider(rollout, g, item.shape, place, item.name);
    record_worst(item.name, rollout.worst);
  }
}

TEST(UpdatedLoadsAdjoint, MatchesDifferencesForNodeContact) {
  const LoadedCase cases[] = {
      {"nodes with glue", Law::kNeoHookean, Shape::kPlane, shape::ContactKind::kGlue, 0.0},
      {"nodes without slip", Law::kNeoHookean, Shape::kPlane, shape::ContactKind::kNoSlip, 0.0},
      {"slip nodes", Law::kNewtonian, Shape::kPlane, shape::ContactKind::kSlip, 0.0},
      {"separating nodes", Law::kNeoHookean, Shape::kPlane, shape::ContactKind::kSeparating, 0.0},
      {"sliding nodes", Law::kDruckerPrager, Shape::kSphere, shape::ContactKind::kFriction, 0.1},
      {"nodes with friction", Law::kVonMises, Shape::kTurningBox, shape::ContactKind::kFriction,
       1.0},
      {"nodes in a moving plane", Law::kNewtonian, Shape::kMovingPlane, shape::ContactKind::kGlue,
       0.0},
  };
  for (const LoadedCase& item : cases) {
    Place place;
    place.kind = item.kind;
    place.mu = item.mu;
    place.method = shape::ContactMethod::kNode;
    UpdatedRollout rollout(scene_of(item.law));
    rollout.scene.colliders.push_back(collider(item.shape, place));
    const auto g = rollout.gradient<double>();
    rollout.expect_start(g, kLoadedScale, item.name);
    expect_loaded_material(rollout, g, item.name);
    expect_collider(rollout, g, item.shape, place, item.name);
    record_worst(item.name, rollout.worst);
  }
}

TEST(UpdatedLoadsAdjoint, MatchesDifferencesForPins) {
  for (const bool moved : {false, true}) {
    const std::string name = moved ? "moved pin" : "held pin";
    UpdatedRollout rollout(scene_of(moved ? Law::kVonMises : Law::kNeoHookean));
    Pin pin;
    pin.region = Pin::Region::kBox;
    pin.low = Vec3d(-1.0, -1.0, -1.0);
    pin.high = Vec3d(1.0, 1.0, 0.06);
    if (moved) {
      pin.pivot = Vec3d(0.02, 0.0, 0.0);
      pin.release = 0.0031;
      pin.motion.times = {0.0, 0.01};
      pin.motion.values = {shape::Pose{},
                           shape::Pose{Vec3d(0.002, 0.001, -0.003),
                                       Quatd(Eigen::AngleAxisd(0.2, Vec3d(1, 2, 0).normalized()))}};
    }
    rollout.scene.bodies[0].pins.push_back(pin);
    const auto g = rollout.gradient<double>();
    rollout.expect_start(g, kLoadedScale, name);
    expect_loaded_material(rollout, g, name);
    record_worst(name, rollout.worst);
  }
}

}  // namespace
}  // namespace matterfit::mpm
