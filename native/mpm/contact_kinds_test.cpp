// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <tuple>

#include "mpm/simulation.hpp"
#include "shape/collider.hpp"

/// What the kinds of contact do to a cube that meets a floor at a slant.
namespace matterfit::mpm {
namespace {

using shape::ContactKind;
using shape::ContactMethod;

/// A fifth of a second after a soft cube of 6 cm was thrown at a floor without gravity.
struct Thrown {
  double lowest = 0.0;             ///< particle [m]
  Vec3d velocity = Vec3d::Zero();  ///< mean [m/s]
};

Thrown thrown(Formulation formulation, ContactKind kind, ContactMethod method, double mu) {
  constexpr double kSpacing = 0.01;
  Body body;
  body.name = "cube";
  body.formulation = formulation;
  body.lattice.origin = Vec3d(0.0, 0.0, 0.005);
  body.lattice.spacing = kSpacing;
  body.lattice.regular = true;
  for (int n = 0; n < 216; ++n) {
    body.rest.emplace_back(body.lattice.origin +
                           kSpacing * Vec3d(n % 6 + 0.5, n / 6 % 6 + 0.5, n / 36 + 0.5));
    body.volumes.push_back(kSpacing * kSpacing * kSpacing);
  }
  body.material.youngs_modulus = 1e5;
  body.velocity = Vec3d(1.0, 0.0, -2.0);
  Scene scene;
  scene.dx = 2.0 * kSpacing;
  scene.fps = 100;
  scene.end_frame = 21;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  shape::Contact contact;
  contact.kind = kind;
  contact.method = method;
  contact.mu = mu;
  scene.colliders.push_back(shape::make_plane("floor", contact, Vec3d::Zero(), Vec3d::UnitZ()));
  scene.bodies.push_back(std::move(body));
  Simulation simulation(scene, std::make_shared<Arena>(1));
  for (int frame = 0; frame < 20; ++frame) simulation.advance(Interrupter());
  const BodyState state = simulation.state().bodies[0];
  Thrown result;
  result.lowest = 1e30;
  for (const Vec3f& x : state.positions) result.lowest = std::min(result.lowest, double(x.z()));
  for (const Vec3f& v : state.velocities) result.velocity += v.cast<double>();
  result.velocity /= double(state.velocities.size());
  return result;
}

class ContactKinds : public ::testing::TestWithParam<std::tuple<Formulation, ContactMethod>> {
 protected:
  [[nodiscard]] static Thrown with(ContactKind kind, double mu = 0.0) {
    return thrown(std::get<0>(GetParam()), kind, std::get<1>(GetParam()), mu);
  }
};

INSTANTIATE_TEST_SUITE_P(
    Formulations, ContactKinds,
    ::testing::Values(std::tuple(Formulation::kTotal, ContactMethod::kParticle),
                      std::tuple(Formulation::kUpdated, ContactMethod::kParticle),
                      std::tuple(Formulation::kRenewed, ContactMethod::kParticle),
                      std::tuple(Formulation::kUpdated, ContactMethod::kNode)),
    [](const auto& info) {
      const Formulation formulation = std::get<0>(info.param);
      const std::string name = formulation == Formulation::kTotal     ? "total"
                               : formulation == Formulation::kUpdated ? "updated"
                                                                      : "renewed";
      return name + (std::get<1>(info.param) == ContactMethod::kNode ? "_node" : "_particle");
    });

/// No slip is friction that never gives way: it lets go, and takes more of the motion along the
/// floor than any friction that slides.
TEST_P(ContactKinds, NoSlipHoldsWhilePressedAndLetsGo) {
  const Thrown free = with(ContactKind::kSeparating);
  const Thrown sliding = with(ContactKind::kFriction, 0.1);
  const Thrown held = with(ContactKind::kNoSlip);
  EXPECT_GT(free.lowest, 0.03);
  EXPECT_GT(held.lowest, 0.03);
  EXPECT_GT(held.velocity.z(), 0.3);
  EXPECT_NEAR(free.velocity.x(), 1.0, 0.05);
  EXPECT_LT(sliding.velocity.x(), free.velocity.x() - 0.02);
  EXPECT_LT(held.velocity.x(), sliding.velocity.x() - 0.02);
}

/// By particles: nodes hold only what is inside at the moment.
TEST_P(ContactKinds, GlueNeverLetsGo) {
  if (std::get<1>(GetParam()) == ContactMethod::kNode) return;
  EXPECT_LT(with(ContactKind::kGlue).lowest, 0.01);
}

}  // namespace
}  // namespace matterfit::mpm
