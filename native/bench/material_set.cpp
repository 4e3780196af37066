// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/material_set.hpp"

#include <cmath>
#include <numbers>

#include "base/random.hpp"
#include "bench/reference_shape.hpp"

namespace matterfit::bench {
namespace {

struct Family {
  const char* name;
  ReferenceLaw law;
  std::size_t clips;
  double most_spin;  ///< [rad/s]
};

constexpr Family kFamilies[] = {
    {"elastic", ReferenceLaw::kNeoHookean, 10, 4.0},
    {"newtonian", ReferenceLaw::kNewtonian, 10, 2.0},
    {"nonnewtonian", ReferenceLaw::kHerschelBulkley, 10, 2.0},
    {"plasticine", ReferenceLaw::kVonMises, 10, 4.0},
    {"sand", ReferenceLaw::kDruckerPrager, 5, 1.0},
};

/// Around PAC-NeRF's scenes (droplet and letter, cream and toothpaste, cat and playdoh, torus and
/// bird, trophy) and NCLaw's. PAC-NeRF's fluid has τ = κ(J − J⁻⁶) I + ½ μ J (∇v + ∇vᵀ): K = 7κ and
/// η = μ/2; its plastic viscosity is twice ours.
ReferenceMaterial draw(ReferenceLaw law, Random& random) {
  ReferenceMaterial m;
  m.law = law;
  switch (law) {
    case ReferenceLaw::kNeoHookean:
      m.youngs_modulus = random.log_between(2e5, 1.2e6);
      m.poisson_ratio = random.between(0.2, 0.4);
      break;
    case ReferenceLaw::kNewtonian:
      m.bulk_modulus = 7.0 * random.log_between(5e4, 2e5);
      m.viscosity = 0.5 * random.log_between(50.0, 400.0);
      break;
    case ReferenceLaw::kHerschelBulkley: {
      const double mu = random.log_between(4e3, 1.2e4);
      const double kappa = random.log_between(1e5, 1e6);
      m.youngs_modulus = 9.0 * kappa * mu / (3.0 * kappa + mu);
      m.poisson_ratio = (3.0 * kappa - 2.0 * mu) / (2.0 * (3.0 * kappa + mu));
      m.yield_stress = random.log_between(200.0, 3e3);
      m.viscosity = 0.5 * random.log_between(5.0, 20.0);
      break;
    }
    case ReferenceLaw::kVonMises:
      m.youngs_modulus = random.log_between(3e5, 2e6);
      m.poisson_ratio = random.between(0.25, 0.35);
      m.yield_stress = random.log_between(3.85e3, 1.54e4);
      break;
    case ReferenceLaw::kDruckerPrager:
      m.youngs_modulus = 1e6;
      m.friction_angle = random.between(20.0, 45.0);
      break;
    case ReferenceLaw::kMullins:  // not in this set
      break;
  }
  return m;
}

SetClip clip(const Family& family, const ReferenceShape& shape, std::uint64_t seed) {
  Random random(seed);
  SetClip result;
  result.name = std::string(family.name) + "_" + shape.name;
  result.shape = shape.name;
  result.material = draw(family.law, random);
  result.volume = random.log_between(0.007, 0.018);
  constexpr double kDegree = std::numbers::pi / 180.0;
  const double yaw = random.between(0.0, 360.0) * kDegree;
  const double tilt = random.between(-40.0, 40.0) * kDegree;
  result.turn = Eigen::AngleAxisd(yaw, Vec3d::UnitZ()) * Eigen::AngleAxisd(tilt, Vec3d::UnitX());
  result.velocity = {random.between(-0.8, 0.8), random.between(-0.8, 0.8),
                     random.between(-1.5, 0.0)};
  const Vec3d direction(random.between(-1, 1), random.between(-1, 1), random.between(-1, 1));
  result.spin = family.most_spin * random.uniform() * direction.normalized();
  // It touches the ground after three to five frames.
  const double flight = random.between(3.0, 5.0) / kSetFramesPerSecond;
  result.clearance = -result.velocity.z() * flight + 0.5 * 9.81 * flight * flight;
  result.seed = random.next();
  return result;
}

struct Object {
  const char* name;
  const char* shape;
  ReferenceMaterial material;
  double most_spin;  ///< [rad/s]
};

std::vector<Object> objects() {
  std::vector<Object> all(5);
  all[0] = {"egg", "egg", {.law = ReferenceLaw::kNeoHookean, .youngs_modulus = 1.5e5}, 4.0};
  all[1] = {"bread",
            "box",
            {.law = ReferenceLaw::kVonMises, .youngs_modulus = 3e5, .yield_stress = 5e3},
            4.0};
  all[2] = {"cream",
            "ellipsoid",
            {.law = ReferenceLaw::kNewtonian, .bulk_modulus = 3e5, .viscosity = 60.0},
            2.0};
  all[3] = {"pawn",
            "pawn",
            {.law = ReferenceLaw::kDruckerPrager, .youngs_modulus = 5e5, .friction_angle = 35.0},
            2.0};
  all[4] = {
      "rubber",
      "capsule",
      {.law = ReferenceLaw::kMullins, .youngs_modulus = 4e4, .stiffening = 4.0, .softening = 0.5},
      4.0};
  return all;
}

Vec3d any_direction(Random& random) {
  for (;;) {
    const Vec3d v(random.between(-1, 1), random.between(-1, 1), random.between(-1, 1));
    const double length = v.norm();
    if (length > 0.1 && length < 1.0) return v / length;
  }
}

SetClip sequence(const Object& object, std::size_t number, Random& random) {
  SetClip result;
  result.name = std::string(object.name) + "_" + std::to_string(number);
  result.shape = object.shape;
  result.material = object.material;
  result.volume = 0.01;
  const double turn = random.between(0.0, 2.0 * std::numbers::pi);
  result.turn = Eigen::AngleAxisd(turn, any_direction(random));
  const double across_x = random.between(-1.0, 1.0);
  const double across_y = random.between(-1.0, 1.0);
  result.velocity = {across_x, across_y, random.between(-3.0, -1.0)};
  result.spin = object.most_spin * random.uniform() * any_direction(random);
  const double flight = random.between(2.0, 4.0) / kSetFramesPerSecond;
  result.clearance = -result.velocity.z() * flight + 0.5 * 9.81 * flight * flight;
  result.seed = random.next();
  return result;
}

}  // namespace

std::vector<SetClip> object_set() {
  std::vector<SetClip> clips;
  Random random(7);
  for (const Object& object : objects()) {
    for (std::size_t k = 1; k <= kObjectSequences; ++k) {
      clips.push_back(sequence(object, k, random));
    }
  }
  return clips;
}

std::vector<SetClip> material_set() {
  std::vector<SetClip> clips;
  std::uint64_t seed = 2023;
  for (const Family& family : kFamilies) {
    for (std::size_t k = 0; k < family.clips; ++k) {
      clips.push_back(clip(family, reference_shapes()[k], seed++));
    }
  }
  return clips;
}

}  // namespace matterfit::bench
