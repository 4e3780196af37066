// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/read_keyed.hpp"

namespace matterfit::job {
namespace {

constexpr int kFirstFrame = 0;
constexpr int kLastFrame = 9'999'999;

void read_fps(const JsonValue& value, SceneDoc& scene) {
  if (value.json().is_array()) {
    const auto items = value.items();
    if (items.size() != 2) value.fail("a number or [numerator, denominator]");
    scene.fps_ratio = {items[0].integer(1, 10'000'000), items[1].integer(1, 10'000'000)};
    scene.fps = double(scene.fps_ratio[0]) / double(scene.fps_ratio[1]);
    return;
  }
  scene.fps = value.number({1e-3, 1e6, false, "frames per second"});
  const bool whole = scene.fps == std::floor(scene.fps);
  scene.fps_ratio = whole ? std::array<int, 2>{int(scene.fps), 1} : std::array<int, 2>{0, 0};
}

void read_frames(const JsonValue& value, int& begin, int& end) {
  const auto items = value.items();
  if (items.size() != 2) value.fail("[first, end), two frame numbers");
  begin = items[0].integer(kFirstFrame, kLastFrame);
  end = items[1].integer(kFirstFrame, kLastFrame + 1);
  if (end <= begin) {
    value.refuse("the range [" + std::to_string(begin) + ", " + std::to_string(end) +
                 ") is empty: the second number is the frame after the last.");
  }
}

Vec3d read_bound(const JsonValue& value, double open) {
  if (!value.json().is_array() || value.json().size() != 3) {
    value.fail("three numbers or null (open)");
  }
  Vec3d bound = Vec3d::Constant(open);
  const auto items = value.items();
  for (int i = 0; i < 3; ++i) {
    const JsonValue& item = items[static_cast<std::size_t>(i)];
    if (!item.json().is_null()) bound[i] = item.number();
  }
  return bound;
}

std::vector<mpm::BodyContact> read_contacts(const JsonValue& value, const SceneDoc& scene) {
  std::vector<mpm::BodyContact> contacts;
  for (const JsonValue& item : value.items()) {
    JsonObject object(item);
    const JsonValue pair = object.require("bodies");
    const auto names = pair.items();
    if (names.size() != 2) pair.fail("two names of bodies");
    mpm::BodyContact contact;
    contact.first = resolve_body(names[0], pair, scene);
    contact.second = resolve_body(names[1], pair, scene);
    if (contact.first == contact.second) {
      pair.refuse("a body's contact with itself cannot be set here.");
    }
    Json rest = item.json();
    rest.erase("bodies");
    contact.contact = read_contact(JsonValue(rest, item.path()));
    contacts.push_back(contact);
  }
  return contacts;
}

shape::Pose read_pose(const JsonValue& value) {
  JsonObject object(value);
  shape::Pose pose;
  pose.position = object.vec3("position", pose.position);
  if (const auto rotation = object.find("rotation")) pose.rotation = rotation->quaternion();
  object.finish();
  return pose;
}

SolverDoc read_solver(const JsonValue& value) {
  JsonObject object(value);
  SolverDoc solver;
  solver.cfl = object.number("cfl", solver.cfl, {0.01, 1.0, false, "cells a substep"});
  solver.dt = object.number("dt", solver.dt, not_negative("s"));
  solver.dt_safety = object.number("dt_safety", solver.dt_safety, {0.01, 1.0, false, {}});
  solver.memory_limit_gb =
      object.number("memory_limit_gb", solver.memory_limit_gb, {1e-6, 1e6, false, "GB"});
  solver.grid_shift = object.vec3("grid_shift", solver.grid_shift);
  object.finish();
  return solver;
}

/// `sticky` was the name of `glue`: documents that have it mean what it did.
shape::ContactKind read_contact_kind(const JsonValue& value) {
  if (value.json() == Json("sticky")) return shape::ContactKind::kGlue;
  return static_cast<shape::ContactKind>(
      value.choice({"glue", "slip", "separating", "friction", "no_slip"}));
}

}  // namespace

ByFrame<shape::Pose> read_motion(const JsonValue& value) {
  return read_keyed<shape::Pose>(value, read_pose);
}

shape::Contact read_contact(const JsonValue& value) {
  JsonObject object(value);
  shape::Contact contact;
  if (const auto kind = object.find("kind")) contact.kind = read_contact_kind(*kind);
  contact.mu = object.number("mu", contact.mu, {0.0, 100.0, false, {}});
  contact.stiffness = object.number("stiffness", contact.stiffness, not_negative("Pa/m"));
  if (const auto damping = object.find("damping")) {
    contact.damping = damping->number({0.0, 10.0, false, "of critical"});
  }
  if (const auto method = object.find("method")) {
    contact.method =
        static_cast<shape::ContactMethod>(method->choice({"auto", "particle", "node"}));
  }
  object.finish();
  return contact;
}

ColliderDoc read_collider(const JsonValue& value, const ReadContext& context, std::size_t index) {
  using Shape = ColliderDoc::Shape;
  JsonObject object(value);
  ColliderDoc collider;
  collider.name = object.string("name", "collider" + std::to_string(index));
  const std::size_t given = object.one_of({"shape", "mesh", "meshes"});
  if (given == 0) {
    collider.shape = static_cast<Shape>(
        object.require("shape").choice({"ground", "plane", "sphere", "box", "capsule"}));
  } else {
    collider.shape = given == 1 ? Shape::kMesh : Shape::kMeshes;
  }
  const auto dimension = [&](const char* key) { return object.require(key).number(positive("m")); };
  switch (collider.shape) {
    case Shape::kGround:
      collider.height = object.number("height", 0.0, {-1e6, 1e6, false, "m"});
      break;
    case Shape::kPlane:
      collider.point = object.vec3("point", Vec3d::Zero());
      collider.normal = object.require("normal").unit_vec3();
      break;
    case Shape::kSphere:
      collider.radius = dimension("radius");
      break;
    case Shape::kBox: {
      const JsonValue half = object.require("half_extents");
      collider.half_extents = half.vec3();
      if (collider.half_extents.minCoeff() <= 0.0) half.fail("three numbers > 0 [m]");
      break;
    }
    case Shape::kCapsule:
      collider.radius = dimension("radius");
      collider.half_length = dimension("half_length");
      break;
    case Shape::kMesh:
      collider.files.push_back(context.file(object.require("mesh")));
      break;
    case Shape::kMeshes: {
      const JsonValue files = object.require("meshes");
      for (const JsonValue& file : files.items()) collider.files.push_back(context.file(file));
      if (collider.files.empty()) files.fail("at least one file");
      collider.first_frame = object.require("first_frame").number({-1e7, 1e7, false, "frame"});
      break;
    }
  }
  if (given > 0) collider.voxel_size = object.number("voxel_size", 0.0, not_negative("m"));
  if (collider.shape != Shape::kGround && collider.shape != Shape::kMeshes) {
    if (const auto transform = object.find("transform")) {
      collider.transform = read_motion(*transform);
    }
  }
  if (const auto contact = object.find("contact")) collider.contact = read_contact(*contact);
  object.finish();
  return collider;
}

std::string resolve_body(const std::optional<JsonValue>& value, const JsonValue& owner,
                         const SceneDoc& scene) {
  if (!value) {
    if (scene.bodies.size() == 1) return scene.bodies.front().name;
    owner.refuse("'body' is missing; with several bodies the name of one is needed.");
  }
  const std::string name = value->string();
  std::vector<std::string> names;
  for (const BodyDoc& body : scene.bodies) {
    if (body.name == name) return name;
    names.push_back(body.name);
  }
  std::string message = "there is no body '" + name + "'.";
  if (const auto near = nearest(name, names)) message += " Did you mean '" + *near + "'?";
  value->refuse(message);
}

SceneDoc read_scene(const JsonValue& value, const ReadContext& context) {
  JsonObject object(value);
  SceneDoc scene;
  if (const auto fps = object.find("fps")) read_fps(*fps, scene);
  read_frames(object.require("frames"), scene.first_frame, scene.end_frame);
  if (const auto gravity = object.find("gravity")) {
    scene.gravity = read_keyed<Vec3d>(
        *gravity, [](const JsonValue& item) { return item.vec3(kAccelerationRange); });
  }
  scene.particle_separation = object.require("particle_separation").number({1e-6, 1e3, false, "m"});
  scene.quality = object.string("quality", "");
  const JsonValue bodies = object.require("bodies");
  for (const JsonValue& item : bodies.items()) {
    scene.bodies.push_back(read_body(item, context));
    for (std::size_t i = 0; i + 1 < scene.bodies.size(); ++i) {
      if (scene.bodies[i].name == scene.bodies.back().name) {
        item.refuse("another body is called '" + scene.bodies[i].name +
                    "' too; every body needs a name of its own.");
      }
    }
  }
  if (scene.bodies.empty()) bodies.fail("at least one body");
  if (const auto colliders = object.find("colliders")) {
    for (const JsonValue& item : colliders->items()) {
      scene.colliders.push_back(read_collider(item, context, scene.colliders.size()));
    }
  }
  if (const auto contacts = object.find("contacts")) {
    scene.contacts = read_contacts(*contacts, scene);
  }
  if (const auto walls = object.find("walls")) {
    JsonObject box(*walls);
    mpm::Walls read;
    const double open = std::numeric_limits<double>::infinity();
    if (const auto low = box.find("low")) read.low = read_bound(*low, -open);
    if (const auto high = box.find("high")) read.high = read_bound(*high, open);
    if (const auto contact = box.find("contact")) read.contact = read_contact(*contact);
    box.finish();
    if (!(read.low.array() < read.high.array()).all()) {
      walls->refuse("'low' must lie below 'high' on every axis.");
    }
    scene.walls = read;
  }
  if (const auto effects = object.find("effects")) {
    for (const JsonValue& item : effects->items()) {
      scene.effects.push_back(read_effect(item, scene));
      for (std::size_t i = 0; i + 1 < scene.effects.size(); ++i) {
        if (scene.effects[i].name != scene.effects.back().name) continue;
        item.refuse("another effect is called '" + scene.effects[i].name +
                    "' too; give each a name of its own.");
      }
    }
  }
  if (const auto solver = object.find("solver")) scene.solver = read_solver(*solver);
  object.finish();
  return scene;
}

}  // namespace matterfit::job
