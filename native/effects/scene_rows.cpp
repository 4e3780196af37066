// SPDX-License-Identifier: GPL-3.0-or-later
#include "effects/scene_rows.hpp"

#include <utility>

namespace matterfit::effects {
namespace {

EffectType row(std::string name, Group group, Scope scope, std::vector<std::string> quantities,
               std::string signature, std::vector<std::string> confused_with,
               std::string sentence) {
  EffectType type;
  type.name = std::move(name);
  type.group = group;
  type.scope = scope;
  type.way = Way::kQuantity;
  type.quantities = std::move(quantities);
  type.signature = std::move(signature);
  type.confused_with = std::move(confused_with);
  type.sentence = std::move(sentence);
  return type;
}

}  // namespace

const std::vector<EffectType>& scene_rows() {
  static const std::vector<EffectType> rows = {
      row("gravity_size", Group::kOutside, Scope::kCapture, {"gravity"},
          "Free flight curves more or less than the scene says, alike at every speed.",
          {"scale", "frame_rate", "drag_quadratic", "drag_linear", "density"},
          "Gravity is weaker or stronger than the scene says, or its unit is wrong."),
      row("gravity_direction", Group::kOutside, Scope::kCapture, {"gravity"},
          "Free flight and what hangs drift to one side, alike at every speed.",
          {"camera_roll", "ground_tilt", "wind", "frame_acceleration"},
          "What the scene calls down is not down: the camera or the table is tilted."),
      row("friction", Group::kContact, Scope::kShared, {"colliders.COLLIDER.contact.mu"},
          "What slides stops too early or too late; free flight is right.",
          {"tracker_bias", "damping_shear", "drag_linear", "ground_tilt"},
          "The surface is rougher or smoother than the scene says."),
      row("restitution", Group::kContact, Scope::kShared, {"colliders.COLLIDER.contact.damping"},
          "Bounces are too high or too low; the flight between them is right.",
          {"damping_shear", "relaxation", "grid"},
          "Impacts take more or less energy than the contact does."),
      row("ground_height", Group::kContact, Scope::kCapture, {"colliders.COLLIDER.height"},
          "Impacts come too early or too late, and rest is at another height.",
          {"time_offset", "scale", "velocity"},
          "The floor is higher or lower than the scene says."),
      row("ground_tilt", Group::kContact, Scope::kCapture, {"colliders.COLLIDER.normal"},
          "What touches the floor drifts to one side; free flight is right.",
          {"gravity_direction", "camera_roll", "friction"}, "The floor is not level."),
      row("damping_shear", Group::kMaterial, Scope::kBody, {"bodies.BODY.material.damping_shear"},
          "Oscillations die down faster than simulated, the faster ones more.",
          {"relaxation", "drag_linear", "friction", "damping_bulk"},
          "The material itself is viscous: it turns motion into heat."),
      row("damping_bulk", Group::kMaterial, Scope::kBody, {"bodies.BODY.material.damping_bulk"},
          "Changes of volume die down faster than simulated.", {"damping_shear", "restitution"},
          "The material resists changes of volume by their speed."),
      row("relaxation", Group::kMaterial, Scope::kBody, {"bodies.BODY.material.maxwell"},
          "The body is stiffer when it moves than when it rests, and creeps under a load.",
          {"damping_shear", "drag_linear", "stiffness_gradient"},
          "The material relaxes: part of its stiffness fades within some time."),
      row("yield", Group::kMaterial, Scope::kBody, {"bodies.BODY.material.yield_stress"},
          "The body keeps a dent, or keeps less of one than simulated.",
          {"hardening", "pre_strain", "rest_shape"},
          "The material flows for good above another stress than the scene says."),
      row("hardening", Group::kMaterial, Scope::kBody, {"bodies.BODY.material.hardening"},
          "A second impact leaves less of a mark than simulated, or more.", {"yield", "damage"},
          "The material becomes harder or softer where it has flowed."),
      row("cohesion", Group::kMaterial, Scope::kBody, {"bodies.BODY.material.cohesion"},
          "Grains hold together where they should run apart.", {"adhesion", "surface_tension"},
          "The grains stick to each other."),
      row("velocity", Group::kState, Scope::kCapture, {"bodies.BODY.velocity"},
          "The body is off in proportion to time from the first frame.",
          {"time_offset", "wind", "camera_drift"},
          "The body is thrown otherwise than the scene says."),
      row("spin", Group::kState, Scope::kCapture, {"bodies.BODY.spin"},
          "The body turns otherwise from the first frame.", {"velocity_gradient", "vortex"},
          "The body is thrown with another spin."),
      row("density", Group::kMaterial, Scope::kBody, {"bodies.BODY.density"},
          "Only what is driven by a known force or weight is off.",
          {"gravity_size", "buoyancy", "scale"},
          "The body is heavier or lighter than the scene says."),
      row("attached_mass", Group::kState, Scope::kBody, {"bodies.BODY.masses"},
          "A part of the body hangs lower and swings more slowly.",
          {"force_field", "density_gradient", "stiffness_gradient"},
          "Something heavy that the scene does not mention hangs on the body."),
  };
  return rows;
}

}  // namespace matterfit::effects
