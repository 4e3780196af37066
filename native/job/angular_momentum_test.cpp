// SPDX-License-Identifier: GPL-3.0-or-later
// A spinning body that strains and that nothing touches, of each neural law: its angular momentum.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "job/documents/neural_starts.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/published_law.hpp"
#include "material/neural/published_material.hpp"
#include "mpm/kernels.hpp"
#include "mpm/plain_mpm_for_test.hpp"
#include "mpm/updated_rollout_for_test.hpp"

namespace matterfit::job {
namespace {

using material::Material;
using material::PointLaw;

constexpr double kFreeStep = 5e-4;  // [s]
constexpr int kFreeSteps = 400;

mpm::Scene free_scene(const Material& material) {
  mpm::Scene scene;
  scene.fps = 100.0;
  scene.dx = 0.05;
  scene.gravity = shape::Keyed<Vec3d>(Vec3d::Zero());
  scene.bodies.push_back(mpm::updated_block_body(material, Vec3d(0.16, -0.03, 0.12), 6, 0.025, 19));
  return scene;
}

struct Flight {
  double change = 0.0;    ///< of the angular momentum, by itself
  double strained = 0.0;  ///< |FᵀF − 1| at its largest
  double apart = 0.0;     ///< the solver's kernels from the plain simulation [m]
};

/// Flies for .2 s in the plain simulation, and for a tenth of that in the solver's kernels beside
/// it.
Flight fly(const Material& material) {
  const mpm::Scene scene = free_scene(material);
  const PointLaw law(material, kFreeStep);
  mpm::PlainMpm plain(scene, [&](const Mat3d& step, material::PointState& state, double) {
    return law.advance(step, state);
  });
  Arena arena(1);
  mpm::UpdatedGroup<double> group(scene, {0}, mpm::kernels<double>(mpm::SimdTarget::kAuto),
                                  std::size_t{1} << 30U);
  (void)group.begin_frame(0.0);
  Flight found;
  const Vec3d before = plain.angular_momentum();
  for (int n = 0; n < kFreeSteps; ++n) {
    plain.step(kFreeStep);
    for (const mpm::PlainMpm::Particle& p : plain.particles()) {
      const Mat3d& f = p.state.elastic;
      found.strained = std::max(found.strained, (f.transpose() * f - Mat3d::Identity()).norm());
    }
    if (n >= kFreeSteps / 10) continue;
    (void)group.step(arena, n * kFreeStep, kFreeStep, Vec3d::Zero());
    const std::vector<mpm::UpdatedParticle> particles = group.particles(0);
    for (std::size_t p = 0; p < particles.size(); ++p) {
      found.apart = std::max(found.apart, (particles[p].position - plain.particles()[p].x).norm());
    }
  }
  found.change = (plain.angular_momentum() - before).norm() / before.norm();
  return found;
}

TEST(AngularMomentum, OursKeepItToRoundingAndThePublishedLawDoesNot) {
  std::vector<std::pair<std::string, Material>> ours;
  for (const char* name : {"jelly", "plasticine", "sand", "water"}) {
    ours.emplace_back(name, material::isotropic_material(neural_start(name)));
  }
  Material latent;
  latent.youngs_modulus = 1e5;
  const std::shared_ptr<const material::LatentDecoder> decoder = latent_preset();
  for (std::size_t c = 0; c < material::kLatentClasses.size(); ++c) {
    const Eigen::VectorXd code = decoder->classes.row(static_cast<Eigen::Index>(c));
    set_latent(latent, decoder, {code.data(), material::kLatentSize});
    // A bulk modulus of 1e5 Pa, whose waves a substep holds in each class.
    latent.youngs_modulus = 3e5 * (1.0 - 2.0 * latent.poisson_ratio);
    ours.emplace_back("latent " + std::string(material::kLatentClasses[c]), latent);
  }
  for (const auto& [name, material] : ours) {
    const Flight flight = fly(material);
    EXPECT_LT(flight.change, 1e-11) << name;
    EXPECT_GT(flight.strained, 1e-4) << name;
    EXPECT_LT(flight.apart, 1e-9) << name;
    mpm::record_worst(name, flight.change);
  }
  for (const char* name : {"jelly", "plasticine", "sand"}) {
    const Flight flight = fly(material::published_material(published_start(name)));
    EXPECT_GT(flight.change, 1e-9) << name;
    EXPECT_LT(flight.change, 0.1) << name;
    EXPECT_LT(flight.apart, 1e-9) << name;
    mpm::record_worst(std::string("published ") + name, flight.change);
  }
}

}  // namespace
}  // namespace matterfit::job
