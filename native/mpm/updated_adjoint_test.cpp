// SPDX-License-Identifier: GPL-3.0-or-later
// The adjoint of updated Lagrangian substeps against central differences in double: each law, with
// and without damping and relaxation, and two bodies on one grid.
#include "mpm/updated_adjoint.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "mpm/updated_contact.hpp"
#include "mpm/updated_pins.hpp"
#include "mpm/updated_rollout_for_test.hpp"

namespace matterfit::mpm {
namespace {

using material::Law;
using material::Material;

/// Gradients (by the logarithm of what is positive) are of this size.
constexpr double kCaseScale = 0.1;

Scene free_scene(const Material& material) {
  Scene scene;
  scene.fps = 100.0;
  scene.dx = 0.05;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d(1.0, -2.0, -9.0));
  scene.bodies.push_back(updated_block_body(material, Vec3d(0.16, -0.03, 0.12), 6, 0.025, 19));
  return scene;
}

struct AdjointCase {
  std::string name;
  Material material;
};

std::vector<AdjointCase> adjoint_cases() {
  std::vector<AdjointCase> all;
  Material m;
  m.youngs_modulus = 3e5;
  m.poisson_ratio = 0.3;
  const auto add = [&](const char* name, Law law) {
    m.law = law;
    all.push_back({name, m});
  };
  add("corotated", Law::kFixedCorotated);
  add("neo-Hookean", Law::kNeoHookean);
  add("Hencky", Law::kStvkHencky);
  m.poisson_ratio = 0.47;
  add("split neo-Hookean", Law::kNeoHookean);
  m.poisson_ratio = 0.3;
  m.damping_shear = 20.0;
  m.damping_bulk = 10.0;
  add("damped corotated", Law::kFixedCorotated);
  add("damped Hencky", Law::kStvkHencky);
  m.maxwell = {{5e4, 1e-3}, {8e4, 0.02}};
  add("relaxing", Law::kNeoHookean);
  m.damping_shear = m.damping_bulk = 0.0;
  m.yield_stress = 500.0;
  m.hardening = 1e4;
  add("von Mises", Law::kVonMises);
  m.maxwell.clear();
  m.hardening = 0.0;
  m.viscosity = 30.0;
  add("Herschel-Bulkley", Law::kHerschelBulkley);
  m.exponent = 0.7;
  add("shear-thinning", Law::kHerschelBulkley);
  m.exponent = 1.0;
  m.friction_angle = 30.0;
  m.cohesion = 2e3;
  add("Drucker-Prager", Law::kDruckerPrager);
  m.cohesion = 0.0;
  add("Drucker-Prager without cohesion", Law::kDruckerPrager);
  m.bulk_modulus = 2e5;
  m.viscosity = 10.0;
  add("Newtonian", Law::kNewtonian);
  m.viscosity = 0.0;
  m.damping_shear = 5.0;
  m.maxwell = {{1e4, 2e-3}};
  add("Newtonian with a branch", Law::kNewtonian);
  return all;
}

void expect_material(UpdatedRollout& rollout, const UpdatedRollout::Gradient& all,
                     const std::string& name) {
  for (std::size_t b = 0; b < rollout.scene.bodies.size(); ++b) {
    const Material& m = rollout.scene.bodies[b].material;
    const material::MaterialGradient& g = all.material[b];
    const auto of = [&](const char* what, double gradient, double Material::*member) {
      const double value = m.*member;
      rollout.expect(
          value * gradient, kCaseScale, name + ", " + what, 1e-4 * value,
          [&](Scene& scene, double by) { scene.bodies[b].material.*member += by; }, value);
    };
    const bool fluid = m.law == Law::kNewtonian;
    if (!fluid) of("E", g.youngs_modulus, &Material::youngs_modulus);
    if (!fluid) of("nu", g.poisson_ratio, &Material::poisson_ratio);
    if (fluid) of("K", g.bulk_modulus, &Material::bulk_modulus);
    if (m.damping_shear > 0.0) of("damping", g.damping_shear, &Material::damping_shear);
    if (m.damping_bulk > 0.0) of("bulk damping", g.damping_bulk, &Material::damping_bulk);
    if (m.law == Law::kVonMises && m.hardening > 0.0)
      of("hardening", g.hardening, &Material::hardening);
    if (m.law == Law::kVonMises || m.law == Law::kHerschelBulkley) {
      of("yield", g.yield_stress, &Material::yield_stress);
    }
    if ((m.law == Law::kHerschelBulkley || fluid) && m.viscosity > 0.0) {
      of("viscosity", g.viscosity, &Material::viscosity);
    }
    // From below 1 to above another branch of the return mapping begins: on either side only.
    if (m.law == Law::kHerschelBulkley && m.exponent != 1.0) {
      of("exponent", g.exponent, &Material::exponent);
    }
    if (m.law == Law::kDruckerPrager) {
      of("friction angle", g.friction_angle, &Material::friction_angle);
      if (m.cohesion > 0.0) of("cohesion", g.cohesion, &Material::cohesion);
    }
    for (std::size_t k = 0; k < m.maxwell.size(); ++k) {
      const double modulus = m.maxwell[k].modulus;
      rollout.expect(
          modulus * g.maxwell[k].modulus, kCaseScale, name + ", modulus", 1e-3 * modulus,
          [&](Scene& scene, double by) { scene.bodies[b].material.maxwell[k].modulus += by; },
          modulus);
      const double time = m.maxwell[k].time;
      rollout.expect(
          time * g.maxwell[k].time, kCaseScale, name + ", time", 1e-3 * time,
          [&](Scene& scene, double by) { scene.bodies[b].material.maxwell[k].time += by; }, time);
    }
  }
}

/// Cells of the first body's particles before a substep: block and cell in it.
std::vector<std::pair<std::size_t, std::size_t>> cells(const UpdatedRecord<double>& record,
                                                       const Scene& scene) {
  std::vector<std::pair<std::size_t, std::size_t>> all(scene.bodies[0].rest.size());
  const std::size_t slabs = kSlabs * scene.bodies.size();
  for (std::size_t s = 0; s + 1 < record.slab_chunks.size(); ++s) {
    if (s % slabs >= kSlabs) continue;
    for (std::uint32_t k = record.slab_chunks[s]; k < record.slab_chunks[s + 1]; ++k) {
      const KeptChunk<double>& chunk = record.chunks[k];
      for (std::size_t l = 0; l < kLanes; ++l) {
        if (chunk.a[UpdatedChunk<double>::kVolume][l] > 0.0) {
          all[chunk.id[l]] = {s / slabs, s % kSlabs * kLanes + l};
        }
      }
    }
  }
  return all;
}

/// How many times particles changed their cell, and in how many of those their block.
std::pair<int, int> crossings(const std::vector<UpdatedRecord<double>>& records,
                              const Scene& scene) {
  std::pair<int, int> count{0, 0};
  for (std::size_t n = 1; n < records.size(); ++n) {
    if (records[n].before != records[n - 1].after) continue;
    const auto from = cells(records[n - 1], scene);
    const auto to = cells(records[n], scene);
    for (std::size_t p = 0; p < from.size(); ++p) {
      count.first += from[p] != to[p] ? 1 : 0;
      count.second += from[p].first != to[p].first ? 1 : 0;
    }
  }
  return count;
}

TEST(UpdatedAdjoint, MatchesDifferencesForEveryLaw) {
  for (const AdjointCase& item : adjoint_cases()) {
    UpdatedRollout rollout(free_scene(item.material));
    std::vector<UpdatedRecord<double>> records;
    (void)rollout.run<double>(&records);
    const auto [cell, block] = crossings(records, rollout.scene);
    EXPECT_GT(cell, 15) << item.name;
    EXPECT_GT(block, 5) << item.name;
    const auto g = rollout.gradient<double>(records);
    expect_material(rollout, g, item.name);
    rollout.expect_start(g, kCaseScale, item.name);
    record_worst(item.name, rollout.worst);
  }
}

TEST(UpdatedAdjoint, MatchesDifferencesForBodiesThatShareAGridAndAGround) {
  Material soft;
  soft.law = Law::kVonMises;
  soft.yield_stress = 400.0;
  soft.damping_shear = 3.0;
  soft.maxwell = {{2e4, 5e-3}};
  Scene scene = free_scene(soft);
  Material water;
  water.law = Law::kNewtonian;
  water.bulk_modulus = 2e5;
  water.viscosity = 4.0;
  scene.bodies.push_back(updated_block_body(water, Vec3d(0.16, 0.01, 0.02), 4, 0.025, 7));
  scene.bodies[1].density = 1100.0;
  Pin pin;
  pin.region = Pin::Region::kSphere;
  pin.point = Vec3d(0.2, 0.02, 0.26);
  pin.radius = 0.04;
  scene.bodies[0].pins.push_back(pin);
  shape::Contact contact;
  contact.stiffness = 4e6;
  scene.colliders.push_back(
      shape::make_plane("ground", contact, Vec3d(0, 0, 0.048), Vec3d(0.1, 0, 1)));
  contact.method = shape::ContactMethod::kNode;
  contact.mu = 0.2;
  scene.colliders.push_back(
      shape::make_plane("wall", contact, Vec3d(0.172, 0.0, 0.0), Vec3d(1, 0.1, 0.05)));
  UpdatedRollout rollout(scene);
  std::vector<UpdatedRecord<double>> records;
  (void)rollout.run<double>(&records);
  EXPECT_GT(count_acts<UpdatedTouch<double>>(records.back()), 0U);
  EXPECT_GT(count_acts<UpdatedHold<double>>(records.back()), 0U);
  const auto g = rollout.gradient<double>(records);
  expect_material(rollout, g, "two bodies");
  rollout.expect_start(g, kCaseScale, "two bodies");
  record_worst("two bodies", rollout.worst);
}

TEST(UpdatedAdjoint, FloatsAgreeWithDoubleAndThreadsDoNotMatter) {
  for (const AdjointCase& item : adjoint_cases()) {
    UpdatedRollout rollout(free_scene(item.material));
    shape::Contact contact;
    contact.stiffness = 4e6;
    rollout.scene.colliders.push_back(
        shape::make_plane("ground", contact, Vec3d(0, 0, 0.14), Vec3d(0.1, 0, 1)));
    const auto exact = rollout.gradient<double>();
    const auto one = rollout.gradient<float>(1);
    const auto two = rollout.gradient<float>(2);
    EXPECT_EQ(one.start[0].velocity, two.start[0].velocity) << item.name;
    EXPECT_EQ(one.start[0].log_density, two.start[0].log_density) << item.name;
    EXPECT_EQ(one.material[0].youngs_modulus, two.material[0].youngs_modulus) << item.name;
    EXPECT_EQ(one.colliders[0].translation, two.colliders[0].translation) << item.name;
    EXPECT_LT((one.start[0].velocity - exact.start[0].velocity).norm(),
              1e-3 * exact.start[0].velocity.norm() + 1e-3)
        << item.name;
    const Material& m = item.material;
    const double e = m.law == Law::kNewtonian ? m.bulk_modulus : m.youngs_modulus;
    const auto of = [&](const UpdatedRollout::Gradient& g) {
      return e *
             (m.law == Law::kNewtonian ? g.material[0].bulk_modulus : g.material[0].youngs_modulus);
    };
    EXPECT_NEAR(of(one), of(exact), 2e-3 * std::abs(of(exact)) + 2e-3) << item.name;
  }
}

}  // namespace
}  // namespace matterfit::mpm
