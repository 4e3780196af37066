// SPDX-License-Identifier: GPL-3.0-or-later
#include <numbers>
#include <utility>

#include "fit/model/quantity.hpp"
#include "fit/model/quantity_access.hpp"

namespace matterfit::fit {
namespace {

using material::Material;
using material::MaterialGradient;
using material::MaxwellBranch;

/// The largest that documents hold (material::validate()), with room below the bound.
constexpr double kLargestModulus = 9e12;   // [Pa]
constexpr double kLargestCohesion = 9e11;  // [Pa]
constexpr double kLargestViscosity = 9e8;  // [Pa s]
constexpr double kLargestTime = 9e5;       // [s]

std::vector<Quantity> law_rows() {
  using M = Material;
  using G = MaterialGradient;
  return {
      {.path = "material.E",
       .unit = "Pa",
       .low = 1e2,
       .high = 1e10,
       .usual = {0.0, 1e5},
       .scanned = true,
       .stiffness = true,
       .label = "Young's Modulus",
       .sentence = "Stiffness in tension: jelly 1e4, rubber 1e6, wood 1e10 Pa",
       .words = "the stiffness",
       .record = "the body as it is squeezed, bent or hits something, so that it deforms by more "
                 "than the noise",
       .member = &M::youngs_modulus,
       .of_law = true,
       .required = true,
       .access = material_access(&M::youngs_modulus, &G::youngs_modulus)},
      {.path = "material.nu",
       .coordinate = Coordinate::kLogit,
       .low = 0.01,
       .high = 0.495,
       .usual = {0.0, 0.3},
       .label = "Poisson's Ratio",
       .sentence = "Sideways shrinking over stretching: .5 keeps its volume",
       .words = "Poisson's ratio",
       .record = "the body's sides as it is squeezed or pulled: how much it bulges or thins",
       .member = &M::poisson_ratio,
       .of_law = true,
       .required = true,
       .access = material_access(&M::poisson_ratio, &G::poisson_ratio)},
      {.path = "material.yield_stress",
       .unit = "Pa",
       .largest = kLargestModulus,
       .usual = {0.02, 0.0},
       .scanned = true,
       .label = "Yield Stress",
       .sentence = "Uniaxial stress from which the material keeps its new shape",
       .words = "the stress at which it yields",
       .record = "a harder impact or a heavier load that leaves a dent, and the body at rest after "
                 "it",
       .member = &M::yield_stress,
       .of_law = true,
       .required = true,
       .access = material_access(&M::yield_stress, &G::yield_stress)},
      {.path = "material.hardening",
       .unit = "Pa",
       .largest = kLargestModulus,
       .usual = {0.1, 0.0},
       .label = "Hardening",
       .sentence = "Growth of the yield stress per unit of plastic strain",
       .words = "the hardening",
       .record = "loads of several strengths, each of which leaves a larger dent than the last",
       .member = &M::hardening,
       .of_law = true,
       .access = material_access(&M::hardening, &G::hardening)},
      {.path = "material.viscosity",
       .unit = "Pa s",
       .largest = kLargestViscosity,
       .usual = {0.0, 10.0},
       .scanned = true,
       .label = "Viscosity",
       .sentence = "Dynamic viscosity: water .001, honey 10, toothpaste 100 Pa s",
       .words = "the viscosity",
       .record = "the body as it flows: spreading, pouring or slowly sagging",
       .member = &M::viscosity,
       .of_law = true,
       .access = material_access(&M::viscosity, &G::viscosity)},
      {.path = "material.exponent",
       .low = 0.1,
       .high = 4.0,
       .usual = {0.0, 1.0},
       .label = "Flow Exponent",
       .sentence = "Herschel-Bulkley exponent: below 1 it thins as it flows",
       .words = "the exponent of the flow",
       .record = "flow at speeds that differ by a factor ten or more",
       .member = &M::exponent,
       .of_law = true,
       .access = material_access(&M::exponent, &G::exponent)},
      {.path = "material.friction_angle",
       .unit = "degrees",
       .coordinate = Coordinate::kLinear,
       .scale = 5.0,
       .low = 5.0,
       .high = 65.0,
       .usual = {0.0, 30.0},
       .prior_sigma = 5.0,
       .scanned = true,
       .label = "Friction Angle",
       .sentence = "Angle of internal friction: dry sand 25 to 40 degrees",
       .words = "the friction angle",
       .record = "a column or a heap that collapses, until it lies still",
       .member = &M::friction_angle,
       .of_law = true,
       .required = true,
       .access = material_access(&M::friction_angle, &G::friction_angle)},
      {.path = "material.cohesion",
       .unit = "Pa",
       .largest = kLargestCohesion,
       .usual = {1e-3, 0.0},
       .label = "Cohesion",
       .sentence = "Shear strength without pressure: dry sand 0, wet sand 1e3 Pa",
       .words = "the cohesion",
       .record = "a steep face that holds, and one that breaks off",
       .member = &M::cohesion,
       .of_law = true,
       .access = material_access(&M::cohesion, &G::cohesion)},
      {.path = "material.bulk_modulus",
       .unit = "Pa",
       .largest = kLargestModulus,
       .usual = {0.0, 1e5},
       .scanned = true,
       .stiffness = true,
       .label = "Bulk Modulus",
       .sentence = "Resistance to compression; below real water's 2.2e9 Pa steps stay long",
       .words = "the resistance to a change of volume",
       .record = "a harder impact or a load on a body that cannot give way sideways",
       .member = &M::bulk_modulus,
       .of_law = true,
       .required = true,
       .access = material_access(&M::bulk_modulus, &G::bulk_modulus)},
  };
}

/// A direction in the weights of the isotropic neural law.
Quantity form_row(const char* path, std::string_view label, double Material::*member,
                  double MaterialGradient::*slope) {
  return {.path = path,
          .coordinate = Coordinate::kLinear,
          .scale = 0.1,
          .low = -2.0,
          .high = 2.0,
          .prior_sigma = 0.3,
          .always_prior = true,
          .label = label,
          .sentence =
              "How far the form of the stress is from the start law's, along one direction "
              "of its weights; 1 changes it by its own size",
          .words = "the form of the stress",
          .record =
              "the body as it is stretched, squeezed and sheared by a third of its size or "
              "more",
          .member = member,
          .of_law = true,
          .access = material_access(member, slope)};
}

/// The isotropic neural law beside E and ν.
std::vector<Quantity> neural_rows() {
  using M = Material;
  using G = MaterialGradient;
  constexpr std::string_view kDent =
      "an impact or a load that leaves a dent, and the body at rest after it";
  return {
      form_row("material.form_1", "Form 1", &M::form_1, &G::form_1),
      form_row("material.form_2", "Form 2", &M::form_2, &G::form_2),
      form_row("material.form_3", "Form 3", &M::form_3, &G::form_3),
      form_row("material.form_4", "Form 4", &M::form_4, &G::form_4),
      {.path = "material.yield_strain",
       .low = 1e-5,
       .high = 1e3,
       .usual = {0.0, 0.1},
       .never = material::kNeverStrain,
       .label = "Yield Strain",
       .sentence = "Change of shape from which the material keeps its new shape; from 100 on never",
       .words = "the strain at which it yields",
       .record = kDent,
       .member = &M::yield_strain,
       .of_law = true,
       .access = material_access(&M::yield_strain, &G::yield_strain)},
      {.path = "material.internal_friction",
       .low = 1e-4,
       .high = 10.0,
       .usual = {0.0, 0.3},
       .label = "Internal Friction",
       .sentence = "Growth of the yield strain per loss of volume, as of grains under pressure",
       .words = "the internal friction",
       .record = "a column or a heap that collapses, until it lies still",
       .member = &M::internal_friction,
       .of_law = true,
       .access = material_access(&M::internal_friction, &G::internal_friction)},
      {.path = "material.strain_hardening",
       .low = 1e-4,
       .high = 100.0,
       .usual = {0.0, 0.1},
       .label = "Strain Hardening",
       .sentence = "Growth of the yield strain per plastic strain",
       .words = "the hardening",
       .record = "loads of several strengths, each of which leaves a larger dent than the last",
       .member = &M::strain_hardening,
       .of_law = true,
       .access = material_access(&M::strain_hardening, &G::strain_hardening)},
      {.path = "material.tear_strain",
       .low = 1e-5,
       .high = 1e3,
       .usual = {0.0, 0.01},
       .never = material::kNeverStrain,
       .label = "Tear Strain",
       .sentence = "Growth of volume that it bears before it comes apart; from 100 on any",
       .words = "the strain at which it comes apart",
       .record = "a piece that breaks off",
       .member = &M::tear_strain,
       .of_law = true,
       .access = material_access(&M::tear_strain, &G::tear_strain)},
      {.path = "material.flow_rate",
       .unit = "1/s",
       .low = 1e-3,
       .high = 1e11,
       .usual = {0.0, 1e3},
       .label = "Flow Rate",
       .sentence = "How fast strain beyond the yield strain is lost; its inverse is the time of "
                   "relaxation",
       .words = "the rate of the flow",
       .record = "the body as it flows: spreading, pouring or slowly sagging",
       .member = &M::flow_rate,
       .of_law = true,
       .access = material_access(&M::flow_rate, &G::flow_rate)},
      {.path = "material.flow_thinning",
       .unit = "1/s",
       .low = 1e-3,
       .high = 1e11,
       .usual = {0.0, 1e3},
       .label = "Flow Thinning",
       .sentence = "Growth of the flow rate per strain beyond the yield strain",
       .words = "how the flow thins",
       .record = "flow at speeds that differ by a factor ten or more",
       .member = &M::flow_thinning,
       .of_law = true,
       .access = material_access(&M::flow_thinning, &G::flow_thinning)},
      {.path = "material.weight_moves[#]",
       .coordinate = Coordinate::kLinear,
       .scale = 0.1,
       .low = -6.0,
       .high = 6.0,
       .prior_sigma = 0.3,
       .always_prior = true,
       .label = "Weight",
       .sentence = "How far one weight of the energy is from the start law's",
       .words = "a weight of the energy",
       .record = "the body as it is stretched, squeezed and sheared by a third of its size or more",
       .access = weight_move_access()},
  };
}

/// Damping and relaxation, which every law takes.
std::vector<Quantity> viscous_rows() {
  return {
      {.path = "material.damping_shear",
       .unit = "Pa s",
       .largest = kLargestViscosity,
       .usual = {1e-3, 0.0},
       .label = "Shear Damping",
       .sentence = "Kelvin-Voigt viscosity against change of shape",
       .words = "the damping",
       .record = "the body as it rings freely after an impact",
       .member = &Material::damping_shear,
       .access = material_access(&Material::damping_shear, &MaterialGradient::damping_shear)},
      {.path = "material.damping_bulk",
       .unit = "Pa s",
       .largest = kLargestViscosity,
       .usual = {1e-3, 0.0},
       .label = "Bulk Damping",
       .sentence = "Kelvin-Voigt viscosity against change of volume",
       .words = "the damping of changes of volume",
       .record = "the body as it rings freely after a hard impact, at a higher frame rate",
       .member = &Material::damping_bulk,
       .access = material_access(&Material::damping_bulk, &MaterialGradient::damping_bulk)},
      {.path = "material.maxwell[#].modulus",
       .unit = "Pa",
       .largest = kLargestModulus,
       .usual = {0.1, 0.0},
       .stiffness = true,
       .label = "Modulus",
       .sentence = "Shear modulus that the branch adds before it relaxes",
       .words = "the stiffness of the relaxing part",
       .record = "a fast load and a slow one, or a load that is held and let go",
       .access = maxwell_access(&MaxwellBranch::modulus)},
      {.path = "material.maxwell[#].time",
       .unit = "s",
       .largest = kLargestTime,
       .label = "Relaxation Time",
       .sentence = "Time in which a held stress of the branch falls to 37 %",
       .words = "the time of relaxation",
       .record = "a load that is held, from well before that time has passed until well after it",
       .access = maxwell_access(&MaxwellBranch::time)},
  };
}

std::vector<Quantity> body_rows() {
  constexpr auto kLinear = Coordinate::kLinear;
  return {
      {.path = "density",
       .unit = "kg/m³",
       .usual = {0.0, 1000.0},
       .label = "Density",
       .sentence = "Mass per volume at rest: water 1000 kg/m³",
       .words = "the density",
       .record =
           "contact with a body of known mass, or weigh it: free flight does not depend on it",
       .access = density_access()},
      {.path = "velocity",
       .size = 3,
       .unit = "m/s",
       .coordinate = kLinear,
       .scale = 0.1,
       .low = -50.0,
       .high = 50.0,
       .prior_sigma = 1.0,
       .label = "Velocity",
       .sentence = "Initial velocity of the centre of mass",
       .words = "the initial velocity",
       .record = "more frames before the body touches anything",
       .access = motion_access(&mpm::Body::velocity, &mpm::BodyGradient::velocity)},
      {.path = "spin",
       .size = 3,
       .unit = "rad/s",
       .coordinate = kLinear,
       .low = -200.0,
       .high = 200.0,
       .prior_sigma = 5.0,
       .label = "Spin",
       .sentence = "Initial angular velocity about world axes through the centre of mass",
       .words = "the initial spin",
       .record = "points on all sides of the body, in more frames before it touches anything",
       .access = motion_access(&mpm::Body::spin, &mpm::BodyGradient::spin)},
      {.path = "placement.position",
       .size = 3,
       .unit = "m",
       .coordinate = kLinear,
       .scale_is_separation = true,
       .low = -1.0,
       .high = 1.0,
       .around = true,
       .prior_sigma = 0.02,
       .label = "Position",
       .sentence = "Where the body's own origin is when the motion begins",
       .words = "the starting place",
       .record = "the body at rest, or its first frames",
       .access = position_access()},
      {.path = "placement.rotation",
       .size = 3,
       .unit = "rad",
       .coordinate = kLinear,
       .scale = 0.1,
       .low = -std::numbers::pi,
       .high = std::numbers::pi,
       .prior_sigma = 0.1,
       .label = "Rotation",
       .sentence = "Rotation vector of the body on top of its placement",
       .words = "the starting orientation",
       .record = "points on all sides of the body in the first frames",
       .access = rotation_access()},
  };
}

std::vector<Quantity> scene_rows() {
  return {
      {.path = "gravity",
       .owner = Owner::kScene,
       .size = 3,
       .unit = "m/s²",
       .coordinate = Coordinate::kLinear,
       .low = -100.0,
       .high = 100.0,
       .prior_sigma = 0.1,
       .label = "Gravity",
       .sentence = "Acceleration of all that is free: 9.81 m/s² downwards on Earth",
       .words = "gravity",
       .record = "a longer free flight, or a pendulum beside it",
       .access = gravity_access()},
  };
}

std::vector<Quantity> collider_rows() {
  return {
      {.path = "contact.mu",
       .owner = Owner::kCollider,
       .low = 1e-3,
       .high = 3.0,
       .label = "Friction",
       .sentence = "Coulomb's coefficient: 0 ice, .4 wood, 1 rubber",
       .words = "the friction",
       .record = "the body as it slides along the collider, at an angle or with a sideways throw",
       .access = friction_access()},
      {.path = "contact.stiffness",
       .owner = Owner::kCollider,
       .unit = "Pa/m",
       .label = "Stiffness",
       .sentence = "Pressure per depth of penetration",
       .words = "the stiffness of the contact",
       .record = "a hard contact with the collider at a higher frame rate",
       .access = contact_stiffness_access()},
      {.path = "height",
       .owner = Owner::kCollider,
       .unit = "m",
       .coordinate = Coordinate::kLinear,
       .scale_is_separation = true,
       .low = -1.0,
       .high = 1.0,
       .around = true,
       .prior_sigma = 0.01,
       .slope_of_updated = false,
       .label = "Height",
       .sentence = "Height of a level ground",
       .words = "the collider's height",
       .record = "the body as it rests on the collider",
       .access = height_access()},
  };
}

std::vector<Quantity> capture_rows() {
  return {
      {.path = "start_frame",
       .owner = Owner::kCapture,
       .unit = "frames",
       .coordinate = Coordinate::kLinear,
       .scale = 0.2,
       .low = -2.0,
       .high = 2.0,
       .around = true,
       .prior_sigma = 0.5,
       .label = "Start Frame",
       .sentence = "Scene frame at which the recording begins",
       .words = "the time at which the recording begins",
       .record = "the body as it is let go, at a higher frame rate",
       .access = start_frame_access()},
  };
}

std::vector<Quantity> all_rows() {
  std::vector<Quantity> rows;
  for (auto* of :
       {law_rows, neural_rows, viscous_rows, body_rows, scene_rows, collider_rows, capture_rows}) {
    for (Quantity& row : of()) rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

const std::vector<Quantity>& quantities() {
  static const std::vector<Quantity> rows = all_rows();
  return rows;
}

}  // namespace matterfit::fit
