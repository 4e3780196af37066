// SPDX-License-Identifier: GPL-3.0-or-later
// The adjoint of total Lagrangian contact against central differences in double: every kind, on
// flat, round, cornered and moving colliders.
#include "mpm/total_contact_adjoint.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include "shape/colliders_for_test.hpp"

namespace matterfit::mpm {
namespace {

using namespace shape::test_colliders;

constexpr double kContactH = 0.025;
constexpr double kContactDt = 2e-4;
constexpr int kContactSteps = 60;

struct ContactRollout {
  Shape shape = Shape::kPlane;
  Place place;
  Vec3d velocity = Vec3d(0.8, 0.3, -1.5);
  material::Material material;
  double density = 1000.0;
  bool with_mass = false;
  bool rounded = false;  ///< planes of a skin cut across the boxes of the outer particles
  int length = 4;        ///< in particles
  double dx = 2.0 * kContactH;

  [[nodiscard]] Scene scene() const {
    Scene scene;
    scene.fps = 100.0;
    scene.first_frame = 0;
    scene.end_frame = 2;
    scene.dx = dx;
    scene.gravity = shape::Keyed<Vec3d>(Vec3d(0, 0, -9.81));
    Body body;
    body.name = "bar";
    body.density = density;
    body.formulation = Formulation::kTotal;
    body.material = material;
    body.velocity = velocity;
    body.spin = Vec3d(1, -2, 0.5);
    body.lattice.regular = true;
    body.lattice.spacing = kContactH;
    for (int i = 0; i < length; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) {
          body.rest.emplace_back(kContactH * Vec3d(i + 4.5 - length, j + 0.5, k + 1.4));
          body.volumes.push_back(kContactH * kContactH * kContactH);
        }
    // Some that the collider's direction has before it, some aside, at several depths.
    for (std::uint32_t p = 0; rounded && p < body.rest.size(); p += p % 3 == 0 ? 1 : 2) {
      const Vec3d out(0.3 + 0.05 * (p % 5), -0.2 + 0.1 * (p % 4), -1.0);
      body.skin.push_back({p, out.normalized(), kContactH * (0.4 + 0.1 * (p % 7))});
    }
    if (with_mass) body.masses.push_back({Vec3d(0.06, 0.05, 0.1), 0.1, 0.0});
    scene.bodies.push_back(body);
    scene.colliders.push_back(collider(shape, place));
    return scene;
  }

  static Vec3d weight(std::uint32_t p) {
    return {std::sin(1.0 + p), std::cos(2.0 * p), std::sin(3.0 + 0.7 * p)};
  }
  static double kick(int n) { return n == 0 ? 0.5 * kContactDt : kContactDt; }

  struct Record {
    std::vector<TotalState<double>> states;
    /// Before each substep, and after the last.
    std::vector<std::vector<std::pair<std::uint32_t, ContactMemory>>> memories;
    std::size_t touching = 0;
  };

  double run(Record* record) const {
    const Scene s = scene();
    Arena arena(1);
    TotalBody<double> body(s.bodies[0], s, kernels<double>(SimdTarget::kAuto));
    TotalContact<double> contact(s.bodies[0], s, body);
    contact.wake(0.01, 9.81);
    for (int n = 0; n < kContactSteps; ++n) {
      if (record != nullptr) {
        record->states.push_back(body.record());
        record->memories.push_back(contact.record().memory);
        record->touching += record->memories.back().size();
      }
      body.clear_loads();
      contact.apply(arena, body, {.time = n * kContactDt, .dt = kContactDt});
      body.compute_forces(arena, kContactDt, true);
      body.step_nodes(arena, kick(n), kContactDt, s.gravity.at(0.0), n * kContactDt);
    }
    if (record != nullptr) record->memories.push_back(contact.record().memory);
    double loss = 0.0;
    for (std::uint32_t p = 0; p < body.particles(); ++p)
      loss += 1e3 * weight(p).dot(body.state(body.point(p)).position);
    return loss;
  }

  struct Gradient {
    InitialCotangents initial;
    material::MaterialGradient material;
    double log_density = 0.0;
    shape::ColliderCotangents collider;
  };

  [[nodiscard]] Gradient gradient(const Record& record) const {
    const Scene s = scene();
    Arena arena(1);
    TotalBody<double> body(s.bodies[0], s, kernels<double>(SimdTarget::kAuto));
    TotalAdjoint<double> adjoint(body, material, adjoint_kernels<double>(SimdTarget::kAuto));
    TotalContactAdjoint<double> contact(s.bodies[0], s, body);
    TotalCotangents<double> bar = adjoint.zero();
    std::vector<Vec3d> position_bar;
    for (std::uint32_t p = 0; p < body.particles(); ++p) position_bar.emplace_back(1e3 * weight(p));
    adjoint.add_particles(arena, position_bar, {}, {}, bar);
    for (int n = kContactSteps - 1; n >= 0; --n) {
      contact.set_memory(record.memories[static_cast<std::size_t>(n)],
                         record.memories[static_cast<std::size_t>(n) + 1]);
      adjoint.substep(arena, {n * kContactDt, kContactDt, kick(n), 0.0, s.gravity.at(0.0)},
                      record.states[static_cast<std::size_t>(n)], bar, {&contact});
    }
    return {adjoint.initial(bar), adjoint.material_gradient(bar), bar.log_density,
            contact.colliders()[0]};
  }
};

/// `found` against differences when x moves; where a particle comes into contact between the two
/// sides the difference is none, and a smaller step counts.
void expect(ContactRollout& rollout, double& x, double step, double factor, double found,
            const std::string& what) {
  const double at = x;
  const auto value = [&](double by) {
    x = at + by;
    const double v = rollout.run(nullptr);
    x = at;
    return v;
  };
  double expected = 0.0;
  for (int k = 0; k < 6; ++k) {
    expected = factor *
               (8.0 * (value(step) - value(-step)) - (value(2.0 * step) - value(-2.0 * step))) /
               (12.0 * step);
    if (std::abs(expected - found) <= 1e-6 * std::max(std::abs(expected), 0.1)) return;
    step *= 0.3;
  }
  ADD_FAILURE() << what << ": difference " << expected << ", adjoint " << found;
}

TEST(TotalContactAdjoint, MatchesDifferencesForEveryKindAndCollider) {
  struct Case {
    const char* name;
    Shape shape;
    shape::ContactKind kind;
    double mu;
    bool mass;
    bool across_blocks = false;  ///< some faces lie in another block than their particles
    bool rounded = false;
  };
  const Case cases[] = {
      {"sliding on a plane", Shape::kPlane, shape::ContactKind::kFriction, 0.2, false},
      {"sticking to a plane by friction", Shape::kPlane, shape::ContactKind::kFriction, 5.0, false},
      {"plane with glue", Shape::kPlane, shape::ContactKind::kGlue, 0.0, false},
      {"plane without slip", Shape::kPlane, shape::ContactKind::kNoSlip, 0.0, false},
      {"slip plane", Shape::kPlane, shape::ContactKind::kSlip, 0.0, false},
      {"separating plane", Shape::kPlane, shape::ContactKind::kSeparating, 0.0, false},
      {"plane, with a mass", Shape::kPlane, shape::ContactKind::kFriction, 0.2, true},
      {"sphere under two blocks", Shape::kSphere, shape::ContactKind::kFriction, 0.3, false, true},
      {"sphere", Shape::kSphere, shape::ContactKind::kFriction, 0.3, false},
      {"edge of a box", Shape::kBox, shape::ContactKind::kFriction, 0.3, false},
      {"moving plane", Shape::kMovingPlane, shape::ContactKind::kFriction, 0.3, false},
      {"turning box", Shape::kTurningBox, shape::ContactKind::kGlue, 0.0, false},
      {"capsule", Shape::kCapsule, shape::ContactKind::kFriction, 0.3, false},
      {"rounded, plane", Shape::kPlane, shape::ContactKind::kFriction, 0.3, false, false, true},
      {"rounded, sphere", Shape::kSphere, shape::ContactKind::kFriction, 0.3, false, false, true},
      {"edge of a mesh", Shape::kMesh, shape::ContactKind::kFriction, 0.3, false},
      {"moving mesh", Shape::kMovingMesh, shape::ContactKind::kSeparating, 0.0, false},
  };
  for (const Case& item : cases) {
    ContactRollout rollout;
    rollout.shape = item.shape;
    rollout.place.kind = item.kind;
    rollout.place.mu = item.mu;
    rollout.with_mass = item.mass;
    rollout.rounded = item.rounded;
    if (item.across_blocks) {
      rollout.dx = 2.15 * kContactH;
      rollout.length = 14;
    }
    rollout.material.law = material::Law::kNeoHookean;
    rollout.material.youngs_modulus = 2e5;
    rollout.material.poisson_ratio = 0.35;
    ContactRollout::Record record;
    (void)rollout.run(&record);
    ASSERT_GT(record.touching, 100U) << item.name;
    const auto g = rollout.gradient(record);
    const std::string name = item.name;
    double& e = rollout.material.youngs_modulus;
    expect(rollout, e, 1e-4 * e, e, e * g.material.youngs_modulus, name + ", E");
    expect(rollout, rollout.density, 1e-4 * rollout.density, rollout.density, g.log_density,
           name + ", density");
    double& k = rollout.place.stiffness;
    expect(rollout, k, 1e-4 * k, k, k * g.collider.stiffness, name + ", stiffness");
    if (item.mu > 0.0) {
      expect(rollout, rollout.place.mu, 1e-4, 1.0, g.collider.mu, name + ", mu");
    }
    for (int axis = 0; axis < 3; ++axis) {
      expect(rollout, rollout.velocity[axis], 1e-4, 1.0, g.initial.velocity[axis],
             name + ", velocity");
      expect(rollout, rollout.place.translation[axis], 1e-6, 1e-2,
             1e-2 * g.collider.translation[axis], name + ", translation");
      expect(rollout, rollout.place.rotation[axis], 1e-5, 1e-1, 1e-1 * g.collider.rotation[axis],
             name + ", rotation");
    }
  }
}

}  // namespace
}  // namespace matterfit::mpm
