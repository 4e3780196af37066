// SPDX-License-Identifier: GPL-3.0-or-later
// The published law in the updated Lagrangian formulation: its kernels against a plain MPM of a few
// particles in double, and what of it the kernels must keep.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "base/random.hpp"
#include "material/neural/published_file.hpp"
#include "material/neural/published_for_test.hpp"
#include "material/neural/published_law.hpp"
#include "material/neural/published_material.hpp"
#include "mpm/plain_mpm_for_test.hpp"
#include "mpm/simulation.hpp"
#include "mpm/updated_rollout_for_test.hpp"

namespace matterfit::mpm {
namespace {

using material::kPublishedSubstep;
using material::PublishedWeights;

Scene published_scene(const PublishedWeights& weights) {
  Scene scene;
  scene.fps = 100.0;
  scene.dx = 0.05;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(1.0, -2.0, -9.0));
  const auto material = material::published_material(material::make_published_law(weights, "test"));
  scene.bodies.push_back(updated_block_body(material, Vec3d(0.16, -0.03, 0.12), 6, 0.025, 19));
  return scene;
}

PublishedWeights stirred() { return material::noisy_published(8e4, 5e4, 40.0, 0.25, 3); }

PlainMpm plain_published(const Scene& scene, const PublishedWeights& weights) {
  return {scene, [weights](const Mat3d& step, material::PointState& state, double) {
            using Row = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
            const Row trial = step * state.elastic;
            Row kept;
            Row stress;
            Arena arena(1);
            material::published_forward<double>(weights, material::GeluMode::kPolynomial,
                                                {trial.data(), 9}, {kept.data(), 9},
                                                {stress.data(), 9}, arena);
            state.elastic = kept;
            return Mat3d(stress);
          }};
}

/// The largest differences of places [m], velocities [m/s] and F.
template <class S>
Vec3d difference(const Scene& scene, const PublishedWeights& weights, int steps) {
  Arena arena(1);
  UpdatedGroup<S> group(scene, {0}, kernels<S>(SimdTarget::kAuto), std::size_t{1} << 30U);
  PlainMpm plain = plain_published(scene, weights);
  (void)group.begin_frame(0.0);
  for (int n = 0; n < steps; ++n) {
    (void)group.step(arena, n * kPublishedSubstep, kPublishedSubstep, scene.gravity.at(0.0));
    plain.step(kPublishedSubstep);
  }
  const std::vector<UpdatedParticle> found = group.particles(0);
  Vec3d most = Vec3d::Zero();
  for (std::size_t p = 0; p < found.size(); ++p) {
    const PlainMpm::Particle& at = plain.particles()[p];
    most = most.cwiseMax(Vec3d((found[p].position - at.x).norm(), (found[p].velocity - at.v).norm(),
                               (found[p].deformation_gradient - at.state.elastic).norm()));
  }
  return most;
}

TEST(UpdatedPublished, EqualsAPlainSimulation) {
  const PublishedWeights weights = stirred();
  const Scene scene = published_scene(weights);
  constexpr int kSteps = 40;
  const Vec3d exact = difference<double>(scene, weights, kSteps);
  EXPECT_LT(exact[0], 1e-12);
  EXPECT_LT(exact[1], 1e-10);
  EXPECT_LT(exact[2], 1e-11);
  const Vec3d rounded = difference<float>(scene, weights, kSteps);
  EXPECT_LT(rounded[0], 1e-6);
  EXPECT_LT(rounded[1], 1e-4);
  EXPECT_LT(rounded[2], 1e-5);
  // They have moved and strained.
  PlainMpm plain = plain_published(scene, weights);
  for (int n = 0; n < kSteps; ++n) plain.step(kPublishedSubstep);
  double moved = 0.0;
  double strained = 0.0;
  for (std::size_t p = 0; p < plain.particles().size(); ++p) {
    const PlainMpm::Particle& at = plain.particles()[p];
    moved = std::max(moved, (at.x - scene.bodies[0].rest[p]).norm());
    strained = std::max(
        strained, (at.state.elastic.transpose() * at.state.elastic - Mat3d::Identity()).norm());
  }
  EXPECT_GT(moved, 0.4 * scene.dx);
  EXPECT_GT(strained, 0.01);
}

/// The law's own: τ is not symmetric, so that it turns a body that nothing touches.
TEST(UpdatedPublished, TurnsAFreeBodyByTheSkewPartOfItsStress) {
  const auto turned = [](const PublishedWeights& weights) {
    Scene scene = published_scene(weights);
    scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
    PlainMpm plain = plain_published(scene, weights);
    const Vec3d before = plain.angular_momentum();
    Vec3d impulse = Vec3d::Zero();
    for (int n = 0; n < 40; ++n) {
      impulse += plain.angular_impulse(kPublishedSubstep);
      plain.step(kPublishedSubstep);
    }
    const Vec3d change = plain.angular_momentum() - before;
    EXPECT_LT((change - impulse).norm(), 1e-10 * before.norm());
    return change.norm() / before.norm();
  };
  const double isotropic = turned(material::linear_published(8e4, 5e4, 40.0));
  const double noisy = turned(stirred());
  EXPECT_LT(isotropic, 1e-8);
  EXPECT_GT(noisy, 1e-4);
  record_worst("isotropic", isotropic);
  record_worst("stirred", noisy);
  const std::filesystem::path folder = std::filesystem::path(MATTERFIT_DATA_DIR) / "nclaw_weights";
  for (const char* name : {"jelly", "plasticine", "sand"}) {
    const std::filesystem::path file = folder / (std::string(name) + "_0300.pt");
    if (!std::filesystem::exists(file)) continue;
    record_worst(name, turned(material::read_published_pt(file)));
  }
}

TEST(UpdatedPublished, TheSameBitsForAnyNumberOfThreads) {
  Scene scene = published_scene(stirred());
  scene.bodies[0].material.damping_shear = 2.0;
  scene.bodies[0].material.maxwell = {{1e4, 1e-3}};
  Body other = updated_block_body(material::Material{}, Vec3d(0.16, 0.09, 0.12), 6, 0.025, 7);
  scene.bodies.push_back(other);
  shape::Contact contact;
  contact.stiffness = 4e6;
  scene.colliders.push_back(
      shape::make_plane("ground", contact, Vec3d(0, 0, 0.12), Vec3d(0.1, 0, 1)));
  std::string one;
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    UpdatedGroup<float> group(scene, {0, 1}, kernels<float>(SimdTarget::kAuto),
                              std::size_t{1} << 30U);
    (void)group.begin_frame(0.0);
    for (int n = 0; n < 60; ++n) {
      (void)group.step(arena, n * 3e-4, 3e-4, scene.gravity.at(0.0));
    }
    ByteWriter out;
    group.save(out);
    const std::string text = out.take();
    if (threads == 1) one = text;
    EXPECT_TRUE(text == one) << threads;
  }
}

TEST(UpdatedPublished, EverySimdTargetSimulatesTheSame) {
  const Scene scene = published_scene(stirred());
  Arena arena(1);
  std::vector<UpdatedParticle> lowest;
  for (const SimdTarget target : {SimdTarget::kSse4, SimdTarget::kAvx2, SimdTarget::kAvx512}) {
    const Kernels<float>* table = nullptr;
    try {
      table = &kernels<float>(target);
    } catch (const Error&) {
      continue;  // this processor lacks it
    }
    UpdatedGroup<float> group(scene, {0}, *table, std::size_t{1} << 30U);
    (void)group.begin_frame(0.0);
    for (int n = 0; n < 40; ++n) {
      (void)group.step(arena, n * kPublishedSubstep, kPublishedSubstep, scene.gravity.at(0.0));
    }
    const std::vector<UpdatedParticle> found = group.particles(0);
    if (lowest.empty()) lowest = found;
    for (std::size_t p = 0; p < found.size(); ++p) {
      EXPECT_LT((found[p].position - lowest[p].position).norm(), 1e-6);
      EXPECT_LT((found[p].velocity - lowest[p].velocity).norm(), 1e-4);
    }
  }
  EXPECT_FALSE(lowest.empty());
}

TEST(UpdatedPublished, AdjointMatchesDifferences) {
  for (const bool beside : {false, true}) {
    Scene scene = published_scene(stirred());
    if (beside) {
      scene.bodies[0].material.damping_shear = 20.0;
      scene.bodies[0].material.damping_bulk = 10.0;
      scene.bodies[0].material.maxwell = {{5e4, 1e-3}};
    }
    const std::string name = beside ? "with damping and a branch" : "alone";
    UpdatedRollout rollout(scene);
    const auto g = rollout.gradient<double>();
    rollout.expect_start(g, 0.1, name);
    if (beside) {
      const auto of = [&](const char* what, double gradient, double material::Material::*member) {
        const double value = scene.bodies[0].material.*member;
        rollout.expect(
            value * gradient, 0.1, name + ", " + what, 1e-3 * value,
            [&](Scene& s, double by) { s.bodies[0].material.*member += by; }, value);
      };
      of("damping", g.material[0].damping_shear, &material::Material::damping_shear);
      of("bulk damping", g.material[0].damping_bulk, &material::Material::damping_bulk);
      rollout.expect(
          5e4 * g.material[0].maxwell[0].modulus, 0.1, name + ", modulus", 50.0,
          [](Scene& s, double by) { s.bodies[0].material.maxwell[0].modulus += by; }, 5e4);
    }
    record_worst(name, rollout.worst);
    const auto one = rollout.gradient<float>(1);
    const auto two = rollout.gradient<float>(2);
    EXPECT_EQ(one.start[0].velocity, two.start[0].velocity) << name;
    EXPECT_EQ(one.start[0].log_density, two.start[0].log_density) << name;
    EXPECT_LT((one.start[0].velocity - g.start[0].velocity).norm(),
              1e-3 * g.start[0].velocity.norm() + 1e-3)
        << name;
  }
}

/// On a dyadic grid, so that differences of weights in float are what they are meant to be.
double on_grid(double value, double spacing) { return spacing * std::round(value / spacing); }

TEST(UpdatedPublished, GradientsByWeightsMatchDifferences) {
  using material::kNetFeatures;
  using material::kNetHidden;
  using material::kNetWeights;
  PublishedWeights weights = stirred();
  constexpr std::size_t kLast = kNetHidden * (kNetFeatures + kNetHidden);
  // A direction of all weights: of the elastic net's last layer, in Pa, by larger steps.
  Random random(9);
  std::vector<double> direction(2 * kNetWeights);
  for (std::size_t i = 0; i < direction.size(); ++i) {
    const bool elastic = i < kNetWeights;
    const bool last = i % kNetWeights >= kLast;
    const double unit = last ? (elastic ? 1024.0 : 1.0) : 1.0 / 64.0;
    direction[i] = random.uniform() < 0.5 ? -unit : unit;
    float& weight = elastic ? weights.elastic[i] : weights.plastic[i - kNetWeights];
    weight = static_cast<float>(on_grid(static_cast<double>(weight), unit / 1024.0));
  }
  UpdatedRollout rollout(published_scene(weights));
  rollout.of_published = true;
  const auto g = rollout.gradient<double>();
  ASSERT_EQ(g.material[0].published.size(), direction.size());
  const auto value = [&](double by, bool plastic) {
    PublishedWeights moved = weights;
    std::vector<float>& net = plastic ? moved.plastic : moved.elastic;
    for (std::size_t i = 0; i < kNetWeights; ++i) {
      net[i] += static_cast<float>(by * direction[i + (plastic ? kNetWeights : 0)]);
    }
    UpdatedRollout other = rollout;
    other.scene = published_scene(moved);
    return other.run<double>(nullptr);
  };
  for (const bool plastic : {false, true}) {
    double found = 0.0;
    for (std::size_t i = 0; i < kNetWeights; ++i) {
      const std::size_t at = i + (plastic ? kNetWeights : 0);
      found += direction[at] * g.material[0].published[at];
    }
    constexpr double kStep = 1.0 / 128.0;
    const double expected = (8.0 * (value(kStep, plastic) - value(-kStep, plastic)) -
                             (value(2.0 * kStep, plastic) - value(-2.0 * kStep, plastic))) /
                            (12.0 * kStep);
    const double error = std::abs(found - expected) / std::abs(expected);
    EXPECT_LT(error, 1e-6) << "plastic " << plastic << ": difference " << expected << ", adjoint "
                           << found;
    record_worst(plastic ? "plastic" : "elastic", error);
  }
  // Float, and the same bits for any number of threads.
  const auto one = rollout.gradient<float>(1);
  const auto three = rollout.gradient<float>(3);
  EXPECT_EQ(one.material[0].published, three.material[0].published);
  double exact = 0.0;
  double off = 0.0;
  for (std::size_t i = 0; i < direction.size(); ++i) {
    const double bar = direction[i] * g.material[0].published[i];
    exact = std::max(exact, std::abs(bar));
    off = std::max(off, std::abs(direction[i] * one.material[0].published[i] - bar));
  }
  EXPECT_LT(off, 2e-3 * exact);
}

TEST(UpdatedPublished, OtherFormulationsAreRefusedAndTheSubstepIsTheOneItLearned) {
  Scene scene = published_scene(stirred());
  for (const Formulation formulation : {Formulation::kTotal, Formulation::kRenewed}) {
    scene.bodies[0].formulation = formulation;
    try {
      Simulation(scene, std::make_shared<Arena>(1));
      FAIL() << "nothing was refused";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput);
      EXPECT_THAT(error.what(), testing::HasSubstr("the law neural flows and does not say"));
    }
  }
  scene.bodies[0].formulation = Formulation::kAuto;
  scene.bodies[0].velocity = scene.bodies[0].spin = Vec3d::Zero();
  scene.bodies[0].particle_velocities.clear();
  Simulation simulation(scene, std::make_shared<Arena>(1));
  const FrameReport report = simulation.advance(Interrupter());
  EXPECT_EQ(report.substeps, 20);
  EXPECT_THAT(report.dt_limit, testing::HasSubstr("learned"));
}

}  // namespace
}  // namespace matterfit::mpm
