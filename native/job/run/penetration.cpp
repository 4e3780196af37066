// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/penetration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace matterfit::job {
namespace {

std::string length(double metres) {
  if (metres < 0.01) return fmt::format("{:.2g} mm", 1e3 * metres);
  if (metres < 1.0) return fmt::format("{:.2g} cm", 1e2 * metres);
  return fmt::format("{:.2g} m", metres);
}

/// A step of a path in the document.
std::string step(const std::string& name) {
  const bool plain = !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-';
  });
  return plain ? name : "\"" + name + "\"";
}

}  // namespace

Penetration deepest(const mpm::Scene& scene, const mpm::FrameState& state) {
  Penetration found;
  for (std::size_t b = 0; b < state.bodies.size(); ++b) {
    for (const Vec3f& position : state.bodies[b].positions) {
      for (const shape::ColliderPtr& collider : scene.colliders) {
        const double depth = -collider->closest(position.cast<double>(), state.time).distance;
        if (depth <= found.depth) continue;
        found = {depth, scene.bodies[b].name, collider->name(), collider->contact().stiffness};
      }
    }
  }
  return found;
}

std::string penetration_note(const Penetration& penetration) {
  const std::string now = penetration.stiffness > 0.0
                              ? fmt::format(" (now {:.2g} Pa/m)", penetration.stiffness)
                              : std::string();
  return fmt::format(
      "'{}' sank {} into '{}'. Raise scene.colliders.{}.contact.stiffness{} if it "
      "should not.",
      penetration.body, length(penetration.depth), penetration.collider, step(penetration.collider),
      now);
}

}  // namespace matterfit::job
