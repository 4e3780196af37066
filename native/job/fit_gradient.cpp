// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_gradient.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::job {
namespace {

using Q = FitQuantity;
using material::MaterialGradient;

struct LawNumber {
  FitQuantity quantity;
  double MaterialGradient::*member;
};

constexpr LawNumber kLawNumbers[] = {
    {Q::kYoungsModulus, &MaterialGradient::youngs_modulus},
    {Q::kPoissonRatio, &MaterialGradient::poisson_ratio},
    {Q::kYieldStress, &MaterialGradient::yield_stress},
    {Q::kHardening, &MaterialGradient::hardening},
    {Q::kViscosity, &MaterialGradient::viscosity},
    {Q::kExponent, &MaterialGradient::exponent},
    {Q::kFrictionAngle, &MaterialGradient::friction_angle},
    {Q::kCohesion, &MaterialGradient::cohesion},
    {Q::kBulkModulus, &MaterialGradient::bulk_modulus},
    {Q::kDampingShear, &MaterialGradient::damping_shear},
    {Q::kDampingBulk, &MaterialGradient::damping_bulk},
};

double of_body(const FitPath& path, const mpm::BodyGradient& body) {
  switch (path.quantity) {
    case Q::kDensity:
      return body.density;
    case Q::kVelocity:
      return body.velocity[*path.component];
    case Q::kSpin:
      return body.spin[*path.component];
    case Q::kMaxwellModulus:
      return body.material.maxwell[path.branch].modulus;
    case Q::kMaxwellTime:
      return body.material.maxwell[path.branch].time;
    default:
      break;
  }
  const auto* known =
      std::find_if(std::begin(kLawNumbers), std::end(kLawNumbers),
                   [&](const LawNumber& number) { return number.quantity == path.quantity; });
  if (known == std::end(kLawNumbers)) throw_compute(path.text() + " has no derivative.");
  return body.material.*known->member;
}

double of_collider(const FitPath& path, const mpm::ColliderGradient& collider) {
  switch (path.quantity) {
    case Q::kFriction:
      return collider.mu;
    case Q::kContactStiffness:
      return collider.stiffness;
    default:
      return collider.translation.z();
  }
}

}  // namespace

bool has_gradient(const FitParameters& parameters, std::size_t scene_index,
                  const mpm::Scene& scene) {
  const auto total = std::count_if(scene.bodies.begin(), scene.bodies.end(), mpm::is_total);
  if (total > 0 && scene.bodies.size() > 1) return false;
  if (std::any_of(scene.bodies.begin(), scene.bodies.end(), mpm::is_renewed)) return false;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!parameters.acts_on(i, scene_index)) continue;
    const FitQuantity quantity = parameters.path(i).quantity;
    if (quantity == Q::kPosition || quantity == Q::kRotation || quantity == Q::kStartFrame) {
      return false;
    }
    if (quantity == Q::kHeight && total == 0) return false;
  }
  return true;
}

void add_gradient(const FitParameters& parameters, std::size_t scene_index, const mpm::Scene& scene,
                  const mpm::Gradient& gradient, std::span<double> sum) {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!parameters.acts_on(i, scene_index)) continue;
    const FitPath& path = parameters.path(i);
    if (path.quantity == Q::kGravity) {
      sum[i] += gradient.gravity[*path.component];
    } else if (path.quantity == Q::kFriction || path.quantity == Q::kContactStiffness ||
               path.quantity == Q::kHeight) {
      for (std::size_t c = 0; c < scene.colliders.size(); ++c) {
        if (scene.colliders[c]->name() != path.owner) continue;
        sum[i] += of_collider(path, gradient.colliders[c]);
      }
    } else {
      sum[i] += of_body(path, gradient.bodies[fit::body_index(scene, path.owner)]);
    }
  }
}

}  // namespace matterfit::job
