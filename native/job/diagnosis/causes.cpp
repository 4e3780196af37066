// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/causes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "effects/catalogue.hpp"
#include "effects/effect_type.hpp"
#include "job/diagnosis/cause_row.hpp"
#include "job/diagnosis/contact_causes.hpp"
#include "job/diagnosis/effect_entry.hpp"
#include "job/diagnosis/extent.hpp"
#include "job/diagnosis/hidden_collider.hpp"
#include "job/diagnosis/material_causes.hpp"
#include "job/diagnosis/measurement_causes.hpp"
#include "job/diagnosis/push.hpp"
#include "job/diagnosis/shaking.hpp"
#include "job/diagnosis/stiffness_causes.hpp"
#include "job/diagnosis/surface_places.hpp"

namespace matterfit::job {
namespace {

/// Fewer rows than this, as the front of a flow has, six numbers of a swing fit whatever they show.
constexpr double kRowsForShaking = 200.0;

using diagnose::Effect;
using diagnose::Number;

/// Runs up to which each capture with a scene of its own has causes of its own: each costs slopes.
constexpr std::size_t kMostRuns = 4;
/// Attached masses that are looked at from far off, in the body's own: a third apart in the
/// frequency of a beam that they hang on.
constexpr std::array<double, 4> kTriedMasses = {0.15, 0.3, 0.6, 1.2};
/// The most by which a material may differ between recordings, as a share of its stiffness.
constexpr double kMostChange = 0.8;

class Causes {
 public:
  Causes(const Job& job, const mpm::Scene& scene, const CauseOptions& options)
      : job_(job), scene_(scene), options_(options), body_(extent_of(scene.bodies.front())) {}

  std::vector<Cause> all() {
    gravity();
    terms();
    if (options_.rows >= kRowsForShaking) {
      if (auto cause = shaking(scene_, options_.duration)) causes_.push_back(std::move(*cause));
    }
    if (auto cause = push(options_.encounters, scene_)) causes_.push_back(std::move(*cause));
    std::ranges::move(contact_causes(job_, scene_, options_.fitted), std::back_inserter(causes_));
    if (auto cause = hidden_collider(options_.encounters, scene_)) {
      causes_.push_back(std::move(*cause));
    }
    std::ranges::move(material_causes(scene_, options_), std::back_inserter(causes_));
    std::ranges::move(stiffness_causes(scene_), std::back_inserter(causes_));
    masses();
    changes();
    motion();
    std::ranges::move(measurement_causes(job_, scene_, options_.fitted),
                      std::back_inserter(causes_));
    return std::move(causes_);
  }

 private:
  /// Whether a fit moves that number; of bodies only the first is looked at.
  [[nodiscard]] bool fitted(fit::Owner owner, std::string_view path) const {
    const bool of_body = owner == fit::Owner::kBody;
    return fit::is_among(fit::row_named(owner, path), options_.fitted,
                         of_body ? scene_.bodies.front().name : std::string());
  }

  Cause& add(const char* name, const char* group, const char* sentence) {
    return add_cause(causes_, name, group, sentence);
  }

  void gravity() {
    if (scene_.gravity.values.size() != 1 || fitted(fit::Owner::kScene, "gravity")) return;
    const Vec3d g = scene_.gravity.values.front();
    if (!(g.norm() > 0.0)) return;
    const Vec3d down = g.normalized();
    Cause& size =
        add("gravity_size", "outside", "Gravity is {value} stronger than the scene says.");
    size.row.numbers = {number("added", "m/s²", 0.1)};
    size.row.confused_with = {"scale", "frame_rate"};
    // Captures may have scenes of their own: what is added is added to what each of them says.
    size.apply = [down](std::span<const double> v, int, mpm::Scene& scene) {
      for (Vec3d& gravity : scene.gravity.values) gravity += v[0] * down;
    };
    size.write = [g, down](std::span<const double> v, int, Json& scene) {
      put_gravity(g + v[0] * down, scene);
    };
    const Vec3d across = down.unitOrthogonal();
    const Vec3d along = down.cross(across);
    Cause& turn = add("gravity_direction", "outside",
                      "Gravity pulls {value} across the direction that the scene says.");
    turn.row.numbers = {number("first", "m/s²", 0.1), number("second", "m/s²", 0.1)};
    turn.row.confused_with = {"camera_roll", "ground_tilt", "wind"};
    turn.apply = [across, along](std::span<const double> v, int, mpm::Scene& scene) {
      for (Vec3d& gravity : scene.gravity.values) gravity += v[0] * across + v[1] * along;
    };
    turn.write = [g, across, along](std::span<const double> v, int, Json& scene) {
      put_gravity(g + v[0] * across + v[1] * along, scene);
    };
  }

  /// Rows of the catalogue that are terms of the simulation: their strengths (what has a neutral
  /// value) are the numbers, the rest stands at the usual values. Those that need a place have
  /// none, and a frame's acceleration needs a frequency: shaking().
  void terms() {
    for (const effects::EffectType* type : effects::catalogue()) {
      if (type->way != effects::Way::kTerm || type->find("center")) continue;
      // What is inside a body is measured by its own stiffness: stiffness_causes().
      if (type->group == effects::Group::kMaterial) continue;
      if (type == effects::find_effect_type("frame_acceleration")) continue;
      if (has_effect(scene_, type->name)) continue;
      term(*type);
    }
  }

  void term(const effects::EffectType& type) {
    static constexpr std::array<const char*, 5> kGroups = {"outside", "contact", "material",
                                                           "state", "measurement"};
    Cause cause;
    Effect& row = cause.row;
    row.name = type.name;
    row.scope = "shared";
    row.group = kGroups.at(static_cast<std::size_t>(type.group));
    row.sentence = type.sentence + " ({value})";
    row.confused_with = type.confused_with;
    effects::Effect neutral = effects::make_effect(type.name);
    std::vector<std::size_t> places;
    for (std::size_t p = 0; p < type.parameters.size(); ++p) {
      const effects::EffectParameter& parameter = type.parameters[p];
      if (!parameter.neutral || !places.empty()) continue;
      for (std::size_t c = 0; c < parameter.size; ++c) {
        Number n;
        n.name = parameter.key + (parameter.size > 1 ? "[" + std::to_string(c) + "]" : "");
        n.unit = parameter.unit;
        n.neutral = *parameter.neutral;
        n.scale = parameter.scale;
        n.low = parameter.low;
        n.high = parameter.high;
        n.one_sided = parameter.low >= n.neutral;
        places.push_back(type.offset(p) + c);
        neutral.values[places.back()] = n.neutral;
        row.numbers.push_back(std::move(n));
      }
    }
    if (row.numbers.empty()) return;
    if (!type.beside.empty() && !has_effect(scene_, type.beside)) row.beside = type.beside;
    cause.apply = [neutral, places](std::span<const double> v, int, mpm::Scene& scene) {
      effects::Effect effect = neutral;
      take_shared(scene, effect);
      for (std::size_t k = 0; k < places.size(); ++k) effect.values[places[k]] = v[k];
      scene.effects.push_back(std::move(effect));
    };
    cause.write = [neutral, places](std::span<const double> v, int, Json& scene) {
      effects::Effect effect = neutral;
      for (std::size_t k = 0; k < places.size(); ++k) effect.values[places[k]] = v[k];
      Json entry = effect_entry(effect);
      take_shared(scene, *effect.type, entry);
      scene["effects"].push_back(std::move(entry));
    };
    causes_.push_back(std::move(cause));
  }

  void masses() {
    std::vector<SurfacePlace> places =
        surface_places(scene_.bodies.front(), job_.scene.particle_separation);
    places.push_back({body_.center, "at the centre"});
    mass(places, nullptr);
    if (options_.own_scenes.size() >= kMostRuns) return;
    for (const OwnScene& own : options_.own_scenes) mass(places, &own);
  }

  /// In all scenes, or in that of some captures alone.
  void mass(const std::vector<SurfacePlace>& places, const OwnScene* own) {
    Cause& cause = add("attached_mass", "state", "A mass of {value} is attached {variant}.");
    if (own != nullptr) {
      cause.row.scope = "capture " + own->capture;
      cause.row.sentence = "In '" + own->capture + "' a mass of {value} is attached {variant}.";
      cause.run = own->run;
    }
    const double mass = body_.volume * scene_.bodies.front().density;
    cause.row.numbers = {number("mass", "kg", 0.05 * mass, true)};
    for (const double share : kTriedMasses) cause.row.far_tries.push_back(share * mass);
    cause.row.confused_with = {"material.E", "gravity_size"};
    for (const SurfacePlace& place : places) cause.row.variants.push_back(place.words);
    cause.apply = [places](std::span<const double> v, int variant, mpm::Scene& scene) {
      if (!(v[0] > 0.0)) return;
      mpm::AttachedMass attached;
      attached.position = places[static_cast<std::size_t>(variant)].position;
      attached.mass = v[0];
      scene.bodies.front().masses.push_back(attached);
    };
    const auto entry = [places](std::span<const double> v, int variant) -> Json {
      const Vec3d& at = places[static_cast<std::size_t>(variant)].position;
      return {{"position", {at.x(), at.y(), at.z()}}, {"mass", v[0]}};
    };
    const std::string& name = scene_.bodies.front().name;
    if (own == nullptr) {
      cause.write = [entry, name](std::span<const double> v, int variant, Json& scene) {
        body_named(name, scene)["masses"].push_back(entry(v, variant));
      };
      return;
    }
    // A scene that is laid over another replaces its list.
    cause.write_over = [entry, name, there = own->masses](std::span<const double> v, int variant,
                                                          const Json& /*scene*/, Json& over) {
      Json& masses = body_named(name, over)["masses"];
      if (masses.is_null()) masses = there;
      masses.push_back(entry(v, variant));
    };
  }

  /// A material that is another in one recording: warmer, older, another specimen.
  void changes() {
    const mpm::Body& body = scene_.bodies.front();
    if (options_.own_scenes.size() >= kMostRuns || !body.material.traits().uses("E")) return;
    for (const OwnScene& own : options_.own_scenes) {
      Cause& cause = add("stiffness_change", "material", "");
      cause.row.scope = "capture " + own.capture;
      cause.row.sentence =
          "In '" + own.capture + "' the material is stiffer than elsewhere by a share of {value}.";
      cause.run = own.run;
      cause.row.numbers = {number("share", "", 0.02)};
      cause.row.numbers[0].low = -kMostChange;
      cause.row.numbers[0].high = kMostChange;
      cause.row.confused_with = {"attached_mass", "frame_rate"};
      cause.apply = [](std::span<const double> v, int, mpm::Scene& scene) {
        scene.bodies.front().material.youngs_modulus *= 1.0 + v[0];
      };
      cause.write_over = [name = body.name, usual = body.material.youngs_modulus](
                             std::span<const double> v, int, const Json& scene, Json& over) {
        const Json& body_there = scene.at("bodies").at(0);
        const Json shared = body_there.value("material", Json::object());
        Json& material = body_named(name, over)["material"];
        if (material.is_null()) material = Json::object();
        material["E"] = (1.0 + v[0]) * material.value("E", shared.value("E", usual));
      };
    }
  }

  void motion() {
    const auto vector = [&](const char* name, const char* unit, double scale,
                            Vec3d mpm::Body::*member, const char* sentence) {
      if (fitted(fit::Owner::kBody, name)) return;
      Cause& cause = add(name, "state", sentence);
      for (const char* axis : {"x", "y", "z"})
        cause.row.numbers.push_back(number(axis, unit, scale));
      cause.row.confused_with = {"time_offset"};
      const Vec3d now = scene_.bodies.front().*member;
      cause.apply = [member](std::span<const double> v, int, mpm::Scene& scene) {
        scene.bodies.front().*member += Vec3d(v[0], v[1], v[2]);
      };
      cause.write = [name, now](std::span<const double> v, int, Json& scene) {
        first_body(scene)[name] = {now.x() + v[0], now.y() + v[1], now.z() + v[2]};
      };
    };
    if (!scene_.bodies.front().pins.empty()) return;  // what is held and let go has no throw
    vector("velocity", "m/s", 0.05, &mpm::Body::velocity,
           "The body starts {value} faster than the scene says.");
    vector("spin", "rad/s", 0.2, &mpm::Body::spin,
           "The body turns {value} faster at the start than the scene says.");
  }

  const Job& job_;
  const mpm::Scene& scene_;
  const CauseOptions& options_;
  Extent body_;
  std::vector<Cause> causes_;
};

}  // namespace

std::vector<Cause> scene_causes(const Job& job, const mpm::Scene& scene,
                                const CauseOptions& options) {
  return Causes(job, scene, options).all();
}

}  // namespace matterfit::job
