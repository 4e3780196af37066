// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/contact_nuisances.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "job/diagnosis/extent.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/default_stiffness.hpp"

namespace matterfit::job {
namespace {

/// Standard deviations that a number may be off at most.
constexpr double kMostOff = 30.0;
/// How well a ground's height is known, in sizes of the body.
constexpr double kHeightSigma = 0.01;
/// How well the stiffness of a contact is known, in natural logarithms: solvers differ by decades.
constexpr double kStiffnessSigma = 1.5;
constexpr double kMostStiffness = 5.0;

}  // namespace

fit::Parameter nuisance(std::string name, const char* unit, double sigma, double most) {
  fit::Parameter parameter;
  parameter.name = std::move(name);
  parameter.unit = unit;
  parameter.scale = sigma;
  parameter.low = -most;
  parameter.high = most;
  parameter.prior = fit::Prior{0.0, sigma};
  return parameter;
}

void struck_by_another_solver(const diagnose::Numerics& numerics, mpm::Scene& scene) {
  if (numerics.loss > 0.0 && scene.bodies.front().material.mu() > 0.0) {
    mpm::Body& body = scene.bodies.front();
    // tan δ = η ω/μ, at half a wave through the body.
    const double speed = std::sqrt(body.material.mu() / body.density);
    body.material.damping_shear +=
        numerics.loss * body.material.mu() * extent_of(body).size / (std::numbers::pi * speed);
  }
  if (numerics.contact_stiffness == 1.0 && numerics.contact_damping == 0.0) return;
  const std::vector<double> stiffnesses = mpm::contact_stiffnesses(scene, scene.bodies.front());
  for (std::size_t c = 0; c < scene.colliders.size(); ++c) {
    shape::Contact contact = scene.colliders[c]->contact();
    contact.stiffness = numerics.contact_stiffness * stiffnesses[c];
    contact.damping = mpm::contact_damping(contact) + numerics.contact_damping;
    scene.colliders[c] = mpm::with_contact(scene.colliders[c], contact);
  }
}

ContactNuisances::ContactNuisances(const std::vector<ContactRun>& runs,
                                   const std::vector<std::string>& grounds,
                                   const std::vector<fit::Address>& fitted) {
  double size = 0.0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const ContactRun& run = runs[r];
    std::vector<bool> seen(run.scene->bodies.size(), false);
    for (std::size_t c = 0; c < run.captures.size(); ++c) {
      const std::size_t body = run.bodies[c];
      // Two captures of one body see the same impacts.
      if (seen[body]) continue;
      const std::vector<Impact> found = job::impacts(*run.captures[c], *run.scene, r, body);
      if (found.empty()) continue;
      seen[body] = true;
      size = std::max(size, extent_of(run.scene->bodies[body]).size);
      impacts_.insert(impacts_.end(), found.begin(), found.end());
    }
  }
  if (impacts_.empty()) return;
  const auto is_fitted = [&](const char* path, const std::string& ground) {
    return fit::is_among(fit::row_named(fit::Owner::kCollider, path), fitted, ground);
  };
  for (const std::string& name : grounds) {
    Ground ground;
    ground.name = name;
    ground.height = !is_fitted("height", name);
    ground.stiffness = !is_fitted("contact.stiffness", name);
    if (ground.height) {
      const double sigma = kHeightSigma * size;
      parameters_.push_back(nuisance("height of '" + name + "'", "m", sigma, kMostOff * sigma));
    }
    if (ground.stiffness) {
      parameters_.push_back(
          nuisance("stiffness of '" + name + "'", "", kStiffnessSigma, kMostStiffness));
    }
    grounds_.push_back(std::move(ground));
  }
  of_grounds_ = parameters_.size();
  for (std::size_t k = 0; k < impacts_.size(); ++k) {
    for (std::size_t i = 0; i < kNumbersOfImpact; ++i) {
      const bool turn = i >= 3;
      const double sigma = turn ? impacts_[k].turn : impacts_[k].speed;
      parameters_.push_back(
          nuisance(fmt::format("impact {} {}[{}]", k, turn ? "spin" : "velocity", i % 3),
                   turn ? "rad/s" : "m/s", sigma, kMostOff * sigma));
    }
  }
}

ContactNuisances::Change ContactNuisances::change_after(std::span<const double> values,
                                                        std::size_t impact) const {
  const double* at = values.data() + of_grounds_ + kNumbersOfImpact * impact;
  return {Vec3d(at[0], at[1], at[2]), Vec3d(at[3], at[4], at[5])};
}

void ContactNuisances::set_grounds(std::span<const double> values, mpm::Scene& scene) const {
  std::size_t next = 0;
  for (const Ground& ground : grounds_) {
    const double height = ground.height ? values[next++] : 0.0;
    const double factor = ground.stiffness ? std::exp(values[next++]) : 1.0;
    for (std::size_t c = 0; c < scene.colliders.size(); ++c) {
      const shape::ColliderPtr old = scene.colliders[c];
      if (old->name() != ground.name) continue;
      shape::Contact contact = old->contact();
      // Said also where the factor is 1: a stiffness of the document's does not firm up with depth
      // as the default does, and derivatives are to see one kind of contact.
      if (ground.stiffness) {
        const mpm::Body& struck = scene.bodies[impacts_.front().body];
        contact.stiffness = factor * mpm::contact_stiffnesses(scene, struck)[c];
      }
      const shape::SurfacePoint foot = old->closest(Vec3d::Zero(), 0.0);
      const Vec3d point = (height - foot.distance) * foot.normal;
      scene.colliders[c] = shape::make_plane(old->name(), contact, point, foot.normal);
    }
  }
}

void ContactNuisances::write_grounds(const mpm::Scene& scene, Json& document) const {
  for (const Ground& ground : grounds_) {
    for (Json& entry : document.at("colliders")) {
      if (entry.value("name", "") != ground.name) continue;
      for (const shape::ColliderPtr& collider : scene.colliders) {
        if (collider->name() != ground.name) continue;
        // A level ground: where it lies is how far below the origin.
        if (ground.height) entry["height"] = -collider->closest(Vec3d::Zero(), 0.0).distance;
        if (ground.stiffness) entry["contact"]["stiffness"] = collider->contact().stiffness;
      }
    }
  }
}

std::string ContactNuisances::left_out(std::span<const double> values) const {
  double speed = 0.0;
  double turn = 0.0;
  for (std::size_t k = 0; k < impacts_.size(); ++k) {
    const Change change = change_after(values, k);
    speed = std::max(speed, change.velocity.norm());
    turn = std::max(turn, change.spin.norm());
  }
  return fmt::format(
      "After {} impacts the simulation was set right, by {:.2g} m/s and {:.2g} rad/s at most; the "
      "extended model is without that, so it departs from the recording after the first.",
      impacts_.size(), speed, turn);
}

void ContactNuisances::add_impacts(std::span<const double> values, std::size_t run,
                                   mpm::Scene& scene) const {
  for (std::size_t k = 0; k < impacts_.size(); ++k) {
    const Impact& impact = impacts_[k];
    if (impact.run != run) continue;
    const Change change = change_after(values, k);
    scene.nudges.push_back({impact.body, impact.frame, change.velocity, change.spin});
  }
}

}  // namespace matterfit::job
