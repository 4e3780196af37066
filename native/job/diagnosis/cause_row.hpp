// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "job/diagnosis/causes.hpp"

/// Helpers with which contact_causes, material_causes, measurement_causes and causes write their
/// rows.
namespace matterfit::job {

/// A number that is 0 where its cause is not there; `one_sided`: never below.
[[nodiscard]] inline diagnose::Number number(const char* name, const char* unit, double scale,
                                             bool one_sided = false) {
  diagnose::Number result;
  result.name = name;
  result.unit = unit;
  result.scale = scale;
  result.one_sided = one_sided;
  if (one_sided) result.low = 0.0;
  return result;
}

/// Appends a cause that acts in every capture.
inline Cause& add_cause(std::vector<Cause>& causes, const std::string& name, const char* group,
                        std::string sentence) {
  Cause& cause = causes.emplace_back();
  cause.row.name = name;
  cause.row.scope = "shared";
  cause.row.group = group;
  cause.row.sentence = std::move(sentence);
  return cause;
}

/// Writes a constant gravity [m/s²] into a scene of a document.
inline void put_gravity(const Vec3d& gravity, Json& scene) {
  scene["gravity"] = {gravity.x(), gravity.y(), gravity.z()};
}

[[nodiscard]] inline Json& first_body(Json& scene) { return scene.at("bodies").at(0); }

/// The entry of a body in a scene of a document, made where a scene that is laid over another does
/// not speak of it.
[[nodiscard]] inline Json& body_named(const std::string& name, Json& scene) {
  for (Json& body : scene["bodies"]) {
    if (body.value("name", std::string()) == name) return body;
  }
  scene["bodies"].push_back({{"name", name}});
  return scene["bodies"].back();
}

}  // namespace matterfit::job
