// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/simulation.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>

#include "base/error.hpp"
#include "base/hash.hpp"

namespace matterfit::mpm {
namespace {

using material::Law;

/// A block of particles on a regular lattice, low corner at `low`.
Body block(const std::string& name, const Vec3d& low, const Vec3i& counts, double h) {
  Body body;
  body.name = name;
  body.lattice.origin = low;
  body.lattice.spacing = h;
  body.lattice.regular = true;
  for (int i = 0; i < counts[0]; ++i)
    for (int j = 0; j < counts[1]; ++j)
      for (int k = 0; k < counts[2]; ++k) {
        body.rest.emplace_back(low + h * Vec3d(i + 0.5, j + 0.5, k + 0.5));
        body.volumes.push_back(h * h * h);
      }
  return body;
}

Scene scene_with(Body body, double dx) {
  Scene scene;
  scene.dx = dx;
  scene.fps = 100;
  scene.end_frame = 50;
  scene.bodies.push_back(std::move(body));
  return scene;
}

Vec3d mean_position(const BodyState& state) {
  Vec3d sum = Vec3d::Zero();
  for (const Vec3f& x : state.positions) sum += x.cast<double>();
  return sum / static_cast<double>(state.positions.size());
}

/// Hash of everything a frame holds.
std::string bytes_of(const FrameState& state) {
  std::string out;
  for (const BodyState& b : state.bodies) {
    out.append(reinterpret_cast<const char*>(b.positions.data()),
               b.positions.size() * sizeof(Vec3f));
    out.append(reinterpret_cast<const char*>(b.velocities.data()),
               b.velocities.size() * sizeof(Vec3f));
    out.append(reinterpret_cast<const char*>(b.deformation_gradients.data()),
               b.deformation_gradients.size() * sizeof(Mat3f));
  }
  return hash_hex(out);
}

class BothFormulations : public ::testing::TestWithParam<Formulation> {};
INSTANTIATE_TEST_SUITE_P(Solver, BothFormulations,
                         ::testing::Values(Formulation::kTotal, Formulation::kUpdated),
                         [](const auto& info) {
                           return info.param == Formulation::kTotal ? "Total" : "Updated";
                         });

/// Ballistic flight is exact at every frame, thanks to the half kick (closed form).
TEST_P(BothFormulations, FreeFlightIsExact) {
  Body body = block("cube", Vec3d(0.013, 0.02, 1.0), Vec3i(6, 6, 6), 0.01);
  body.formulation = GetParam();
  body.velocity = Vec3d(1.0, -0.5, 2.0);
  Simulation simulation(scene_with(body, 0.02), std::make_shared<Arena>(1));
  const Vec3d start = mean_position(simulation.state().bodies[0]);
  for (int i = 0; i < 20; ++i) simulation.advance(Interrupter());
  const double t = 0.2;
  const Vec3d expected = start + body.velocity * t + 0.5 * t * t * Vec3d(0, 0, -9.81);
  EXPECT_LT((mean_position(simulation.state().bodies[0]) - expected).norm(), 2e-5);
}

/// After a nudge the body flies and turns on with what it was given, and energy is not missed.
TEST(Nudge, IsAddedToTheRigidMotion) {
  Body body = block("cube", Vec3d(-0.03, -0.03, -0.03), Vec3i(6, 6, 6), 0.01);
  body.formulation = Formulation::kTotal;
  body.material.youngs_modulus = 1e6;
  body.velocity = Vec3d(1.0, 0.0, 0.0);
  Scene scene = scene_with(body, 0.02);
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  scene.nudges.push_back({0, 10, Vec3d(-1.0, 0.0, 0.5), Vec3d(0.0, 0.0, 2.0)});
  Simulation simulation(scene, std::make_shared<Arena>(1));
  for (int i = 0; i < 10; ++i) simulation.advance(Interrupter());
  const Vec3d before = mean_position(simulation.state().bodies[0]);
  EXPECT_NEAR(before.x(), 0.1, 1e-5);
  // Saved before it acts, so it acts after loading too.
  const std::string saved = simulation.save();
  for (int i = 0; i < 10; ++i) simulation.advance(Interrupter());
  const FrameState after = simulation.state();
  EXPECT_LT((mean_position(after.bodies[0]) - before - 0.1 * Vec3d(0.0, 0.0, 0.5)).norm(), 2e-5);
  const Vec3d arm = body.rest[0];
  const double angle = 2.0 * 0.1;
  const Vec3d turned(std::cos(angle) * arm.x() - std::sin(angle) * arm.y(),
                     std::sin(angle) * arm.x() + std::cos(angle) * arm.y(), arm.z());
  const Vec3d seen = after.bodies[0].positions[0].cast<double>() - before - Vec3d(0.0, 0.0, 0.05);
  EXPECT_LT((seen - turned).norm(), 1e-4);
  Simulation again(scene, std::make_shared<Arena>(1));
  again.load(saved);
  for (int i = 0; i < 10; ++i) again.advance(Interrupter());
  EXPECT_EQ(bytes_of(again.state()), bytes_of(after));
}

TEST(Nudge, IsForTotalBodiesOnly) {
  Body body = block("cube", Vec3d(-0.03, -0.03, -0.03), Vec3i(6, 6, 6), 0.01);
  body.formulation = Formulation::kUpdated;
  Scene scene = scene_with(body, 0.02);
  scene.nudges.push_back({0, 10, Vec3d::UnitX(), Vec3d::Zero()});
  EXPECT_THROW(Simulation(scene, std::make_shared<Arena>(1)), Error);
}

/// A body that is taken to another place, turn and velocity flies on from there, its shape kept.
TEST(RigidChange, MovesABodyBetweenFrames) {
  Body body = block("cube", Vec3d(-0.03, -0.03, -0.03), Vec3i(6, 6, 6), 0.01);
  body.formulation = Formulation::kTotal;
  body.material.youngs_modulus = 1e6;
  body.velocity = Vec3d(1.0, 0.0, 0.0);
  body.spin = Vec3d(0.0, 0.0, 3.0);
  Scene scene = scene_with(body, 0.02);
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  Simulation simulation(scene, std::make_shared<Arena>(1));
  for (int i = 0; i < 10; ++i) simulation.advance(Interrupter());
  const std::vector<Vec3d> before = simulation.observe(false).bodies[0].positions;
  RigidChange change;
  change.center = Vec3d(0.1, 0.0, 0.0);
  change.rotation = Eigen::AngleAxisd(0.7, Vec3d(1.0, 2.0, 0.5).normalized()).toRotationMatrix();
  change.shift = Vec3d(0.0, 0.3, -0.2);
  change.velocity = -(change.rotation * Vec3d(1.0, 0.0, 0.0));
  change.spin = -(change.rotation * Vec3d(0.0, 0.0, 3.0));
  simulation.change(0, change);
  const std::vector<Vec3d> after = simulation.observe(false).bodies[0].positions;
  for (std::size_t p = 0; p < after.size(); ++p) {
    const Vec3d there =
        change.center + change.shift + change.rotation * (before[p] - change.center);
    EXPECT_LT((after[p] - there).norm(), 1e-12);
  }
  // It rests there.
  for (int i = 0; i < 10; ++i) simulation.advance(Interrupter());
  const std::vector<Vec3d> later = simulation.observe(false).bodies[0].positions;
  for (std::size_t p = 0; p < after.size(); ++p) EXPECT_LT((later[p] - after[p]).norm(), 5e-5);
  EXPECT_THROW(simulation.change(1, change), Error);
}

/// A spinning body keeps its angular velocity and shape (a rigid rotation is affine).
TEST_P(BothFormulations, SpinIsConserved) {
  Body body = block("cube", Vec3d(-0.03, -0.03, -0.03), Vec3i(6, 6, 6), 0.01);
  body.formulation = GetParam();
  body.material.youngs_modulus = 1e6;
  body.spin = Vec3d(0, 0, 5.0);
  Scene scene = scene_with(body, 0.02);
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  Simulation simulation(scene, std::make_shared<Arena>(2));
  const auto spin = [&] {
    const BodyState s = simulation.state().bodies[0];
    double l = 0;
    double inertia = 0;
    for (std::size_t p = 0; p < s.positions.size(); ++p) {
      const Vec3d x = s.positions[p].cast<double>();
      l += x.cross(s.velocities[p].cast<double>())[2];
      inertia += x[0] * x[0] + x[1] * x[1];
    }
    return l / inertia;
  };
  for (int i = 0; i < 30; ++i) simulation.advance(Interrupter());
  EXPECT_NEAR(spin(), 5.0, 0.05);
  EXPECT_LT(mean_position(simulation.state().bodies[0]).norm(), 1e-5);
}

/// The same bits for one and two threads, and after save and load.
TEST_P(BothFormulations, SameBitsForAnyThreadsAndAfterResume) {
  const auto make = [&](int threads) {
    Body body = block("cube", Vec3d(0, 0, 0.05), Vec3i(8, 10, 9), 0.01);
    body.formulation = GetParam();
    body.material.youngs_modulus = 5e4;
    body.velocity = Vec3d(0.4, 0, -1);
    body.spin = Vec3d(3, 1, 0);
    Scene scene = scene_with(body, 0.02);
    shape::Contact contact;
    scene.colliders.push_back(shape::make_plane("ground", contact, Vec3d::Zero(), Vec3d::UnitZ()));
    return std::make_unique<Simulation>(scene, std::make_shared<Arena>(threads));
  };
  auto one = make(1);
  auto two = make(2);
  for (int i = 0; i < 6; ++i) {
    one->advance(Interrupter());
    two->advance(Interrupter());
  }
  ASSERT_EQ(bytes_of(one->state()), bytes_of(two->state()));
  const std::string saved = one->save();
  auto three = make(2);
  three->load(saved);
  for (int i = 0; i < 6; ++i) {
    one->advance(Interrupter());
    three->advance(Interrupter());
  }
  EXPECT_EQ(bytes_of(one->state()), bytes_of(three->state()));
  EXPECT_EQ(three->frame(), 12);
  EXPECT_THROW(three->load(saved.substr(0, saved.size() / 2)), Error);
}

/// A body dropped on the ground stays above it and comes to rest near its rest height.
TEST_P(BothFormulations, DroppedBodyRestsOnTheGround) {
  Body body = block("cube", Vec3d(0.002, 0.003, 0.01), Vec3i(8, 8, 8), 0.01);
  body.formulation = GetParam();
  body.material.law = Law::kFixedCorotated;
  body.material.youngs_modulus = 5e4;
  body.material.damping_shear = 5.0;
  Scene scene = scene_with(body, 0.02);
  shape::Contact contact;
  contact.damping = 0.3;
  scene.colliders.push_back(shape::make_plane("ground", contact, Vec3d::Zero(), Vec3d::UnitZ()));
  Simulation simulation(scene, std::make_shared<Arena>(2));
  for (int i = 0; i < 50; ++i) simulation.advance(Interrupter());
  const BodyState state = simulation.state().bodies[0];
  float lowest = 1.0F;
  for (const Vec3f& x : state.positions) lowest = std::min(lowest, x[2]);
  EXPECT_GT(lowest, 0.0F);
  EXPECT_NEAR(mean_position(state)[2], 0.04, 0.002);
}

/// Two bodies of any formulations bounce off each other: momentum is kept, and they part.
class Pairs : public ::testing::TestWithParam<std::pair<Formulation, Formulation>> {};
INSTANTIATE_TEST_SUITE_P(Solver, Pairs,
                         ::testing::Values(std::pair(Formulation::kTotal, Formulation::kTotal),
                                           std::pair(Formulation::kTotal, Formulation::kUpdated),
                                           std::pair(Formulation::kUpdated, Formulation::kUpdated),
                                           std::pair(Formulation::kTotal, Formulation::kRenewed),
                                           std::pair(Formulation::kRenewed,
                                                     Formulation::kRenewed)));

TEST_P(Pairs, CollideWithoutPassingThrough) {
  Body left = block("left", Vec3d(0, 0, 0), Vec3i(6, 6, 6), 0.01);
  Body right = block("right", Vec3d(0.085, 0.004, 0.003), Vec3i(6, 6, 6), 0.01);
  left.formulation = GetParam().first;
  right.formulation = GetParam().second;
  left.velocity = Vec3d(1, 0, 0);
  left.material.youngs_modulus = right.material.youngs_modulus = 1e5;
  right.density = 2000;
  Scene scene = scene_with(left, 0.02);
  scene.bodies.push_back(right);
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  Simulation simulation(scene, std::make_shared<Arena>(2));
  for (int i = 0; i < 15; ++i) simulation.advance(Interrupter());
  const FrameState state = simulation.state();
  const double a = mean_position(state.bodies[0])[0];
  const double b = mean_position(state.bodies[1])[0];
  EXPECT_GT(b - a, 0.055);
  double momentum = 0;
  for (const Vec3f& v : state.bodies[0].velocities) momentum += 1000 * static_cast<double>(v[0]);
  for (const Vec3f& v : state.bodies[1].velocities) momentum += 2000 * static_cast<double>(v[0]);
  EXPECT_NEAR(momentum / 216 / 1000, 1.0, 0.01);
  EXPECT_GT(b, 0.1155);
}

/// Every law runs, keeps its mass where it should be, and none gains energy from nothing.
TEST(Simulation, EveryLawFallsOnTheGround) {
  for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean, Law::kStvkHencky, Law::kVonMises,
                        Law::kHerschelBulkley, Law::kDruckerPrager, Law::kNewtonian}) {
    Body body = block("cube", Vec3d(0.0, 0.0, 0.005), Vec3i(8, 8, 8), 0.01);
    body.material.law = law;
    body.material.youngs_modulus = 1e5;
    body.material.yield_stress = 500;
    body.material.viscosity = 1.0;
    body.material.bulk_modulus = 5e4;
    Scene scene = scene_with(body, 0.02);
    scene.colliders.push_back(
        shape::make_plane("ground", shape::Contact{}, Vec3d::Zero(), Vec3d::UnitZ()));
    Simulation simulation(scene, std::make_shared<Arena>(2));
    double fastest = 0;
    for (int i = 0; i < 20; ++i) {
      fastest = std::max(fastest, simulation.advance(Interrupter()).max_speed);
    }
    const Vec3d mean = mean_position(simulation.state().bodies[0]);
    EXPECT_LT(fastest, 4.0) << material::traits(law).name;
    EXPECT_NEAR(mean[0], 0.04, 0.005) << material::traits(law).name;
    EXPECT_GT(mean[2], 0.0) << material::traits(law).name;
    EXPECT_LT(mean[2], 0.05) << material::traits(law).name;
  }
}

TEST(Simulation, RefusesWhatCannotBeSimulated) {
  Scene empty;
  EXPECT_THROW(Simulation(empty, std::make_shared<Arena>(1)), Error);
  Body body = block("cube", Vec3d::Zero(), Vec3i(2, 2, 2), 0.01);
  body.density = -1;
  EXPECT_THROW(Simulation(scene_with(body, 0.02), std::make_shared<Arena>(1)), Error);
  body.density = 1000;
  body.material.poisson_ratio = 0.5;
  EXPECT_THROW(Simulation(scene_with(body, 0.02), std::make_shared<Arena>(1)), Error);
}

/// A cube half below the ground (Blender's default cube): an error with both names, no explosion.
TEST(Simulation, BodyInsideAColliderIsRefusedByName) {
  Scene scene = scene_with(block("cube", Vec3d(0, 0, -0.05), Vec3i(10, 10, 10), 0.01), 0.02);
  scene.colliders.push_back(
      shape::make_plane("ground", shape::Contact{}, Vec3d::Zero(), Vec3d::UnitZ()));
  try {
    const Simulation simulation(scene, std::make_shared<Arena>(1));
    FAIL() << "must be refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    EXPECT_NE(std::string(error.what()).find("'cube' starts"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("'ground'"), std::string::npos) << error.what();
  }
}

TEST(Simulation, CancelEndsItsPreparation) {
  const Scene solid = scene_with(block("cube", Vec3d::Zero(), Vec3i(4, 4, 4), 0.01), 0.02);
  Scene flow = scene_with(block("cube", Vec3d::Zero(), Vec3i(30, 30, 30), 0.01), 0.02);
  flow.bodies[0].formulation = Formulation::kUpdated;
  Interrupter interrupter;
  Simulation::Options options;
  options.interrupter = &interrupter;
  const auto prepare = [&](const Scene& scene) {
    const Simulation simulation(scene, std::make_shared<Arena>(1), options);
  };
  prepare(solid);
  prepare(flow);
  interrupter.cancel();
  for (const Scene& scene : {solid, flow}) {
    try {
      prepare(scene);
      ADD_FAILURE() << "it was prepared in spite of Cancel";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kCancelled) << error.what();
    }
  }
}

TEST(Simulation, CancelEndsAFrame) {
  Simulation simulation(scene_with(block("cube", Vec3d::Zero(), Vec3i(4, 4, 4), 0.01), 0.02),
                        std::make_shared<Arena>(1));
  Interrupter interrupter;
  interrupter.cancel();
  try {
    simulation.advance(interrupter);
    FAIL() << "a cancelled frame must throw";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCancelled);
  }
}

}  // namespace
}  // namespace matterfit::mpm
