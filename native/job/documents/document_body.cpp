// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "fit/model/quantity.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/excitation_document.hpp"
#include "job/documents/neural_starts.hpp"

namespace matterfit::job {
namespace {

std::vector<PinDoc> read_pins(const JsonValue& value, const ReadContext& context) {
  std::vector<PinDoc> pins;
  for (const JsonValue& item : value.items()) {
    JsonObject object(item);
    PinDoc pin;
    pin.region = read_region(object.require("region"), context);
    if (const auto motion = object.find("motion")) pin.motion = read_motion(*motion);
    pin.pivot = object.vec3("pivot", pin.pivot);
    if (const auto release = object.find("release")) pin.release = release->number();
    object.finish();
    pins.push_back(std::move(pin));
  }
  return pins;
}

std::vector<MassDoc> read_masses(const JsonValue& value) {
  std::vector<MassDoc> masses;
  for (const JsonValue& item : value.items()) {
    JsonObject object(item);
    MassDoc mass;
    mass.position = object.require("position").vec3();
    mass.mass = object.require("mass").number(positive("kg"));
    if (const auto attach = object.find("attach")) mass.attach = attach->number();
    object.finish();
    masses.push_back(mass);
  }
  return masses;
}

void check_name(const JsonValue& value, const std::string& name) {
  const bool bad = name.empty() || name.size() > 200 || name == "." || name == ".." ||
                   std::any_of(name.begin(), name.end(), [](char c) {
                     return c == '/' || c == '\\' || static_cast<unsigned char>(c) < 32;
                   });
  if (bad) value.fail("a name of 1 to 200 bytes without / and \\ (files are called after it)");
}

}  // namespace

Region read_region(const JsonValue& value, const ReadContext& context) {
  JsonObject object(value);
  Region region;
  region.shape = static_cast<Region::Shape>(
      object.require("shape").choice({"all", "plane", "box", "sphere", "points"}));
  switch (region.shape) {
    case Region::Shape::kAll:
      break;
    case Region::Shape::kPlane:
      region.point = object.require("point").vec3();
      region.normal = object.require("normal").unit_vec3();
      break;
    case Region::Shape::kBox:
      region.low = object.require("low").vec3();
      region.high = object.require("high").vec3();
      if (!(region.low.array() <= region.high.array()).all()) {
        value.refuse("'low' lies above 'high' on some axis.");
      }
      break;
    case Region::Shape::kSphere: {
      const JsonValue center = object.require("center");
      region.point = center.vec3();
      region.radius = object.require("radius").number(positive("m"));
      break;
    }
    case Region::Shape::kPoints:
      region.file = context.file(object.require("file"));
      region.radius = object.require("radius").number(positive("m"));
      break;
  }
  object.finish();
  return region;
}

Placement read_placement(const JsonValue& value) {
  JsonObject object(value);
  Placement placement;
  placement.position = object.vec3("position", placement.position, kPlaceRange);
  if (const auto rotation = object.find("rotation")) placement.rotation = rotation->quaternion();
  placement.scale = object.number("scale", 1.0, positive());
  object.finish();
  return placement;
}

Eigen::AlignedBox3d read_box(const JsonValue& value) {
  JsonObject object(value);
  const Vec3d low = object.require("low").vec3(kPlaceRange);
  const Vec3d high = object.require("high").vec3(kPlaceRange);
  object.finish();
  if (!(low.array() < high.array()).all()) {
    value.refuse("'low' must lie below 'high' on every axis.");
  }
  return {low, high};
}

Source read_source(const JsonValue& value, const ReadContext& context) {
  using Kind = Source::Kind;
  JsonObject object(value);
  Source source;
  source.kind = static_cast<Kind>(
      object.one_of({"points", "mesh", "cage", "gaussians", "box", "sphere", "cylinder"}));
  switch (source.kind) {
    case Kind::kPoints:
      source.file = context.file(object.require("points"));
      break;
    case Kind::kMesh:
      source.file = context.file(object.require("mesh"));
      break;
    case Kind::kCage:
      source.file = context.file(object.require("cage"));
      source.level = object.integer("level", source.level, 0, 6);
      break;
    case Kind::kGaussians:
      source.file = context.file(object.require("gaussians"));
      source.fill_inside = object.boolean("fill_inside", source.fill_inside);
      source.opacity_threshold =
          object.number("opacity_threshold", source.opacity_threshold, {0.0, 1.0, false, {}});
      if (const auto crop = object.find("crop")) source.crop = read_box(*crop);
      break;
    case Kind::kBox: {
      const Eigen::AlignedBox3d box = read_box(object.require("box"));
      source.low = box.min();
      source.high = box.max();
      break;
    }
    case Kind::kSphere: {
      JsonObject sphere(object.require("sphere"));
      source.center = sphere.vec3("center", source.center, kPlaceRange);
      source.radius = sphere.require("radius").number(positive("m"));
      sphere.finish();
      break;
    }
    case Kind::kCylinder: {
      JsonObject cylinder(object.require("cylinder"));
      source.center = cylinder.vec3("center", source.center, kPlaceRange);
      source.radius = cylinder.require("radius").number(positive("m"));
      source.height = cylinder.require("height").number(positive("m"));
      if (const auto axis = cylinder.find("axis")) source.axis = axis->unit_vec3();
      cylinder.finish();
      break;
    }
  }
  if (const auto sampling = object.find("sampling")) {
    source.sampling =
        static_cast<Source::Sampling>(sampling->choice({"auto", "lattice", "jitter"}));
  }
  if (const auto anchor = object.find("anchor")) source.anchor = anchor->vec3();
  if (const auto rotation = object.find("rotation")) source.rotation = rotation->quaternion();
  object.finish();
  return source;
}

namespace {

/// The name of a start law, or a file.
std::shared_ptr<const material::IsotropicStart> read_weights(const JsonValue& value,
                                                             const ReadContext& context) {
  const std::string text = value.string();
  try {
    return is_weights_file(text) ? read_weights_file(context.file(value)) : neural_start(text);
  } catch (const Error& error) {
    value.refuse(error.what());
  }
}

/// The decoder of the latent law.
std::shared_ptr<const material::LatentDecoder> read_decoder(const std::optional<JsonValue>& value,
                                                            const ReadContext& context) {
  if (!value) return latent_preset();
  const std::string text = value->string();
  try {
    if (is_weights_file(text)) return read_latent_file(context.file(*value));
  } catch (const Error& error) {
    value->refuse(error.what());
  }
  if (text != kLatentName) {
    value->refuse("the law latent has the weights 'latent', or those of a file *.safetensors.");
  }
  return latent_preset();
}

/// The weights of the published law.
std::shared_ptr<const material::PublishedLaw> read_published(const std::optional<JsonValue>& value,
                                                             const ReadContext& context) {
  if (!value) return published_start(kDefaultNeuralStart);
  const std::string text = value->string();
  try {
    return is_weights_file(text) ? read_published_file(context.file(*value))
                                 : published_start(text);
  } catch (const Error& error) {
    value->refuse(error.what());
  }
}

/// The code of the latent law; empty: the document has none.
std::vector<double> read_code(JsonObject& object) {
  std::vector<double> code;
  const auto value = object.find("latent");
  if (!value) return code;
  for (const JsonValue& number : value->items()) code.push_back(number.number());
  if (code.size() != material::kLatentSize) {
    value->refuse("has " + std::to_string(code.size()) + " numbers; a code has " +
                  std::to_string(material::kLatentSize) + ".");
  }
  return code;
}

}  // namespace

material::Material read_material(const JsonValue& value, const ReadContext& context) {
  JsonObject object(value);
  const JsonValue law = object.require("law");
  const std::string name = law.string();
  material::Material material;
  try {
    material.law = material::law_from_name(name);
  } catch (const Error& error) {
    law.refuse(error.what());
  }
  if (material.law == material::Law::kNeuralIsotropic) {
    const auto weights = object.find("weights");
    material = material::isotropic_material(weights ? read_weights(*weights, context)
                                                    : neural_start(kDefaultNeuralStart));
  } else if (material.law == material::Law::kLatent) {
    const auto decoder = read_decoder(object.find("weights"), context);
    set_latent(material, decoder, read_code(object));
  } else if (material.law == material::Law::kPublished) {
    material = material::published_material(read_published(object.find("weights"), context));
  } else if (object.has("weights")) {
    value.refuse("the law " + name + " has no weights; leave 'weights' out.");
  }
  for (const fit::Quantity& row : fit::quantities()) {
    if (!row.of_law) continue;
    const std::string key(row.key());
    if (!material.traits().uses(key)) {
      if (object.has(key.c_str())) {
        std::string message = "the law ";
        message.append(name).append(" does not use '").append(key).append("'; it takes");
        for (const auto& used : material.traits().parameters) message.append(" ").append(used);
        if (material.traits().parameters.empty()) message += " none";
        value.refuse(message + ".");
      }
      continue;
    }
    if (const auto found = object.find(key.c_str())) {
      material.*row.member = found->number();
    } else if (row.required && (!material.start || material.law == material::Law::kLatent)) {
      std::string message = "'";
      message.append(key).append("' is missing; the law ").append(name).append(" needs it.");
      value.refuse(message);
    }
  }
  if (const auto moves = object.find("weight_moves")) {
    if (material.law != material::Law::kNeuralIsotropic) {
      moves->refuse("the law " + name + " has no weights; leave it out.");
    }
    for (const JsonValue& move : moves->items()) material.weight_moves.push_back(move.number());
  }
  material.damping_shear = object.number("damping_shear", 0.0, not_negative("Pa s"));
  material.damping_bulk = object.number("damping_bulk", 0.0, not_negative("Pa s"));
  if (const auto branches = object.find("maxwell")) {
    for (const JsonValue& item : branches->items()) {
      JsonObject branch(item);
      material::MaxwellBranch read;
      read.modulus = branch.require("modulus").number(not_negative("Pa"));
      read.time = branch.require("time").number(positive("s"));
      branch.finish();
      material.maxwell.push_back(read);
    }
  }
  if (const auto correction = object.find("correction")) {
    for (const JsonValue& item : correction->items()) {
      material.correction.push_back(item.number());
    }
  }
  object.finish();
  material::validate(material, value.path());
  return material;
}

BodyDoc read_body(const JsonValue& value, const ReadContext& context) {
  JsonObject object(value);
  BodyDoc body;
  const JsonValue name = object.require("name");
  body.name = name.string();
  check_name(name, body.name);
  body.source = read_source(object.require("source"), context);
  body.density = object.require("density").number(positive("kg/m³"));
  body.material = read_material(object.require("material"), context);
  if (const auto formulation = object.find("formulation")) {
    body.formulation =
        static_cast<mpm::Formulation>(formulation->choice({"auto", "total", "updated", "renewed"}));
  }
  body.velocity = object.vec3("velocity", body.velocity, kSpeedRange);
  body.spin = object.vec3("spin", body.spin, kSpinRange);
  if (const auto placement = object.find("placement")) {
    body.placement = read_placement(*placement);
  }
  if (const auto pins = object.find("pins")) body.pins = read_pins(*pins, context);
  if (const auto masses = object.find("masses")) body.masses = read_masses(*masses);
  if (const auto seed = object.find("seed")) {
    body.seed = static_cast<std::uint64_t>(seed->integer(0, 2'147'483'647));
  }
  if (const auto excited = object.find("excited")) body.excited = read_excitation(*excited);
  object.finish();
  return body;
}

}  // namespace matterfit::job
