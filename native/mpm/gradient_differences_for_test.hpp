// SPDX-License-Identifier: GPL-3.0-or-later
// Gradients of whole runs against fourth-order differences of whole runs, in double.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "mpm/gradient_runs_for_test.hpp"

namespace matterfit::mpm {

/// A number of the case and what the gradient says of it.
struct GradientEntry {
  std::string name;
  std::function<double&(GradientCase&)> at;
  double found;
  double unit;  ///< by which it may change
};

inline std::vector<GradientEntry> gradient_entries(const GradientCase& run, const Gradient& g) {
  using material::Law;
  std::vector<GradientEntry> all;
  const auto add = [&](const std::string& name, double found, double unit,
                       std::function<double&(GradientCase&)> at) {
    all.push_back({name, std::move(at), found, unit});
  };
  const auto of_material = [&](const char* name, double found, double material::Material::*member) {
    add(name, found, run.material.*member,
        [member](GradientCase& c) -> double& { return c.material.*member; });
  };
  // The case's numbers move the neighbour too, but for its material and density.
  BodyGradient body = g.bodies[0];
  for (std::size_t b = 1; b < g.bodies.size(); ++b) {
    body.offset += g.bodies[b].offset;
    body.rotation += g.bodies[b].rotation;
    body.velocity += g.bodies[b].velocity;
    body.spin += g.bodies[b].spin;
  }
  const material::Material& m = run.material;
  using material::Material;
  if (m.law == Law::kNewtonian) {
    of_material("K", body.material.bulk_modulus, &Material::bulk_modulus);
    of_material("viscosity", body.material.viscosity, &Material::viscosity);
  } else {
    of_material("E", body.material.youngs_modulus, &Material::youngs_modulus);
    of_material("nu", body.material.poisson_ratio, &Material::poisson_ratio);
  }
  if (m.damping_shear > 0.0) {
    of_material("damping", body.material.damping_shear, &Material::damping_shear);
    of_material("bulk damping", body.material.damping_bulk, &Material::damping_bulk);
  }
  if (m.law == Law::kVonMises || m.law == Law::kHerschelBulkley) {
    of_material("yield", body.material.yield_stress, &Material::yield_stress);
    of_material("hardening", body.material.hardening, &Material::hardening);
  }
  if (m.law == Law::kHerschelBulkley) {
    of_material("viscosity", body.material.viscosity, &Material::viscosity);
  }
  if (m.law == Law::kDruckerPrager) {
    of_material("friction angle", body.material.friction_angle, &Material::friction_angle);
    of_material("cohesion", body.material.cohesion, &Material::cohesion);
  }
  for (std::size_t b = 0; b < m.maxwell.size(); ++b) {
    add("modulus", body.material.maxwell[b].modulus, m.maxwell[b].modulus,
        [b](GradientCase& c) -> double& { return c.material.maxwell[b].modulus; });
    add("time", body.material.maxwell[b].time, m.maxwell[b].time,
        [b](GradientCase& c) -> double& { return c.material.maxwell[b].time; });
  }
  add("density", body.density, run.density, [](GradientCase& c) -> double& { return c.density; });
  const Scene scene = run.scene();
  double stir = 0.0;
  for (std::size_t b = 0; b < g.bodies.size(); ++b) {
    for (std::size_t p = 0; p < scene.bodies[b].rest.size(); ++p) {
      stir +=
          g.bodies[b].particle_velocities[p].dot(scene.bodies[b].particle_velocities[p]) / run.stir;
    }
  }
  add("particle velocities", stir, 1.0, [](GradientCase& c) -> double& { return c.stir; });
  for (int axis = 0; axis < 3; ++axis) {
    const auto vector = [&](const char* name, const Vec3d& found, double unit,
                            Vec3d GradientCase::*member) {
      add(std::string(name) + " " + "xyz"[axis], found[axis], unit,
          [member, axis](GradientCase& c) -> double& { return (c.*member)[axis]; });
    };
    vector("offset", body.offset, 0.1, &GradientCase::offset);
    vector("turn", body.rotation, 0.1, &GradientCase::turn);
    vector("velocity", body.velocity, 1.0, &GradientCase::velocity);
    vector("spin", body.spin, 10.0, &GradientCase::spin);
    vector("gravity", g.gravity, 10.0, &GradientCase::gravity);
    if (run.ground && run.method == shape::ContactMethod::kParticle) {
      vector("translation", g.colliders[0].translation, 0.01, &GradientCase::translation);
      vector("rotation", g.colliders[0].rotation, 0.1, &GradientCase::rotation);
    }
  }
  if (run.ground) {
    add("mu", g.colliders[0].mu, run.mu, [](GradientCase& c) -> double& { return c.mu; });
  }
  if (run.ground && run.method == shape::ContactMethod::kParticle) {
    add("stiffness", g.colliders[0].stiffness, run.stiffness,
        [](GradientCase& c) -> double& { return c.stiffness; });
    add("contact damping", g.colliders[0].damping, run.contact_damping,
        [](GradientCase& c) -> double& { return c.contact_damping; });
  }
  return all;
}

inline void make_fluid(material::Material& material, double viscosity = 10.0) {
  material.law = material::Law::kNewtonian;
  material.bulk_modulus = 2e5;
  material.viscosity = viscosity;
}

/// A Herschel-Bulkley paste that relaxes.
inline void make_paste(material::Material& material) {
  material.law = material::Law::kHerschelBulkley;
  material.yield_stress = 800.0;
  material.viscosity = 30.0;
  material.maxwell = {{2e4, 5e-3}};
}

inline void make_sand(material::Material& material) {
  material.law = material::Law::kDruckerPrager;
  material.friction_angle = 30.0;
  material.cohesion = 2e3;
  material.maxwell.clear();
}

/// Every entry, or `only` some, to 1e-6 of its difference, or of 1 where that is larger; losses are
/// of the order of 500. Where a particle begins to touch or to yield between the two sides the
/// difference is none: then a smaller step counts.
inline void expect_differences(const std::string& name, const GradientCase& run,
                               const std::set<std::string>& only = {}) {
  constexpr double kScale = 1.0;
  const Gradient g = run.gradient<double>();
  if (run.ground) {
    const double felt = run.method == shape::ContactMethod::kNode
                            ? g.colliders[0].mu
                            : run.stiffness * g.colliders[0].stiffness;
    EXPECT_GT(std::abs(felt), 1e-3) << name << " does not touch";
  }
  for (const GradientEntry& entry : gradient_entries(run, g)) {
    if (!only.empty() && only.count(entry.name) == 0) continue;
    const auto value = [&](double by) {
      GradientCase moved = run;
      entry.at(moved) += by * entry.unit;
      return moved.loss(g.schedule);
    };
    double step = 1e-3;
    double error = 0.0;
    double expected = 0.0;
    for (int k = 0; k < 5; ++k, step *= 0.1) {
      expected = (8.0 * (value(step) - value(-step)) - (value(2.0 * step) - value(-2.0 * step))) /
                 (12.0 * step);
      const double now =
          std::abs(expected - entry.unit * entry.found) / std::max(std::abs(expected), kScale);
      error = k == 0 ? now : std::min(error, now);
      if (error <= 1e-6) break;
    }
    EXPECT_LE(error, 1e-6) << name << ", " << entry.name << ": difference " << expected
                           << ", gradient " << entry.unit * entry.found;
  }
}

}  // namespace matterfit::mpm
