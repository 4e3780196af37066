// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/scene_check.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.hpp"

namespace matterfit::mpm {

bool is_total(const Body& body) {
  if (body.formulation == Formulation::kTotal) return true;
  if (body.formulation != Formulation::kAuto) return false;
  return body.material.traits().elastic();
}

bool is_renewed(const Body& body) { return body.formulation == Formulation::kRenewed; }
bool is_updated(const Body& body) { return !is_renewed(body) && !is_total(body); }

void check_scene(const Scene& scene) {
  const auto positive = [](double value, const char* name) {
    if (!(value > 0.0) || !std::isfinite(value)) {
      throw_input(std::string("scene.") + name + " = " + std::to_string(value) +
                  " must be a positive number.");
    }
  };
  positive(scene.fps, "fps");
  positive(scene.dx, "particle_separation");
  positive(scene.dt_safety, "solver.dt_safety");
  positive(scene.cfl, "solver.cfl");
  if (scene.cfl > 1.0) throw_input("scene.solver.cfl must not exceed 1 cell a substep.");
  if (scene.end_frame <= scene.first_frame) {
    throw_input("scene.frames: the end must be after the first frame; the range is half-open.");
  }
  if (scene.bodies.empty()) throw_input("scene.bodies is empty: nothing would be simulated.");
  for (const Nudge& nudge : scene.nudges) {
    const std::string where = "The nudge at frame " + std::to_string(nudge.frame);
    if (nudge.body >= scene.bodies.size() || !is_total(scene.bodies[nudge.body])) {
      throw_input(where + " is for body " + std::to_string(nudge.body) +
                  ", which is not one of the scene's total Lagrangian ones.");
    }
    if (!nudge.velocity.allFinite() || !nudge.spin.allFinite()) {
      throw_input(where + " is not finite.");
    }
  }
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const Body& body = scene.bodies[i];
    const std::string where = "scene.bodies[" + std::to_string(i) + "] ('" + body.name + "')";
    if (body.rest.empty()) {
      throw_input(where + " has no particles. Is the particle separation larger than the body?");
    }
    if (body.volumes.size() != body.rest.size()) {
      throw_input(where + " has " + std::to_string(body.rest.size()) + " particles and " +
                  std::to_string(body.volumes.size()) + " volumes.");
    }
    if (!(body.density > 0.0) || !std::isfinite(body.density)) {
      throw_input(where + ".density = " + std::to_string(body.density) +
                  " must be a positive number [kg/m³].");
    }
    if (!body.particle_velocities.empty() && body.particle_velocities.size() != body.rest.size()) {
      throw_input(where + " has " + std::to_string(body.particle_velocities.size()) +
                  " velocities for " + std::to_string(body.rest.size()) + " particles.");
    }
    for (std::size_t p = 0; p < body.rest.size(); ++p) {
      if (!body.rest[p].allFinite() || !(body.volumes[p] > 0.0) ||
          !std::isfinite(body.volumes[p])) {
        throw_input(where + ": particle " + std::to_string(p) +
                    " has a position that is not finite or a volume that is not positive.");
      }
    }
    const double h = 0.5 * scene.dx;
    if (body.lattice.regular &&
        !(body.lattice.spacing > 0.25 * h && body.lattice.spacing < 4.0 * h)) {
      throw_input(where + ": its particles are " + std::to_string(body.lattice.spacing) +
                  " m apart, and scene.particle_separation is " + std::to_string(h) +
                  " m. Is the unit right? Scale the body, or set the separation to theirs.");
    }
    material::validate(body.material, where + ".material");
    if (body.material.published && (is_total(body) || is_renewed(body))) {
      throw_input(
          where +
          ": the law neural flows and does not say how much of a deformation is elastic, so "
          "it is simulated in the formulation 'updated' alone. Use 'auto' or 'updated'.");
    }
    if (is_added(body.material.traits().family) && is_renewed(body)) {
      throw_input(where + ": the law " + std::string(body.material.traits().name) +
                  " has no kernels for the formulation 'renewed'. Use 'total' or 'updated'.");
    }
    if (body.formulation == Formulation::kTotal && body.material.traits().fluid) {
      throw_input(where +
                  ": a fluid flows; formulation 'total' is for bodies that stay solid. Use "
                  "'auto' or 'updated'.");
    }
  }
  const auto renewed = std::find_if(scene.bodies.begin(), scene.bodies.end(), is_renewed);
  const auto other = std::find_if(scene.bodies.begin(), scene.bodies.end(), is_updated);
  if (renewed != scene.bodies.end() && other != scene.bodies.end()) {
    throw_input("Bodies '" + renewed->name + "' and '" + other->name +
                "' may touch each other, and bodies of the formulations 'renewed' and 'updated' "
                "share no grid. Set one of them for both.");
  }
  for (std::size_t i = 0; i < scene.contacts.size(); ++i) {
    const BodyContact& pair = scene.contacts[i];
    const std::string where = "scene.contacts[" + std::to_string(i) + "]";
    const auto updated = [&](const std::string& name) {
      return std::any_of(scene.bodies.begin(), scene.bodies.end(),
                         [&](const Body& body) { return body.name == name && !is_total(body); });
    };
    if (updated(pair.first) && updated(pair.second)) {
      throw_input(where + ": '" + pair.first + "' and '" + pair.second +
                  "' share a grid: they stick where they "
                  "touch, and nothing else can be set. Remove the entry, or set the formulation of "
                  "one to 'total'.");
    }
    if (pair.contact.method == shape::ContactMethod::kNode) {
      throw_input(where + ".method: between bodies contact acts on particles. Remove it.");
    }
  }
  for (std::size_t i = 0; i < scene.effects.size(); ++i) {
    const effects::Effect& effect = scene.effects[i];
    const std::string where = "scene.effects[" + std::to_string(i) + "]";
    effects::check_effect(effect, where);
    const auto is_named = [&](const Body& body) { return body.name == effect.body; };
    if (!effect.body.empty() && std::none_of(scene.bodies.begin(), scene.bodies.end(), is_named)) {
      throw_input(where + ".body: there is no body '" + effect.body + "'.");
    }
  }
}

}  // namespace matterfit::mpm
