// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/causes.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "effects/catalogue.hpp"
#include "effects/effect_type.hpp"
#include "job/diagnosis/effect_entry.hpp"
#include "job/diagnosis/extent.hpp"
#include "job/diagnosis/hidden_collider.hpp"
#include "job/diagnosis/stiffness_causes.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/default_stiffness.hpp"
#include "shape/collider.hpp"

namespace matterfit::job {
namespace {

using diagnose::Effect;
using diagnose::Number;
using diagnose::Observation;

/// Times of a Maxwell branch that are scanned, as shares of the recording's
/// duration.
constexpr std::array<double, 5> kRelaxationShares = {0.003, 0.01, 0.03, 0.1, 0.3};

Json& first_body(Json& scene) { return scene.at("bodies").at(0); }

Number number(const char* name, const char* unit, double scale, bool one_sided = false) {
  Number result;
  result.name = name;
  result.unit = unit;
  result.scale = scale;
  result.one_sided = one_sided;
  if (one_sided) result.low = 0.0;
  return result;
}

class Causes {
 public:
  Causes(const Job& job, const mpm::Scene& scene, const CauseOptions& options)
      : job_(job), scene_(scene), options_(options), body_(extent_of(scene.bodies.front())) {}

  std::vector<Cause> all() {
    gravity();
    terms();
    contact();
    if (auto cause = hidden_collider(options_.encounters, scene_)) {
      causes_.push_back(std::move(*cause));
    }
    material();
    std::ranges::move(stiffness_causes(scene_), std::back_inserter(causes_));
    masses();
    motion();
    measurement();
    return std::move(causes_);
  }

 private:
  [[nodiscard]] bool fitted(const std::string& key) const {
    return std::any_of(options_.fitted.begin(), options_.fitted.end(),
                       [&](const auto& path) { return path.find(key) != std::string::npos; });
  }

  Cause& add(const char* name, const char* group, const char* sentence) {
    Cause& cause = causes_.emplace_back();
    cause.row.name = name;
    cause.row.scope = "shared";
    cause.row.group = group;
    cause.row.sentence = sentence;
    return cause;
  }

  void gravity() {
    if (scene_.gravity.values.size() != 1 || fitted("gravity")) return;
    const Vec3d g = scene_.gravity.values.front();
    if (!(g.norm() > 0.0)) return;
    const Vec3d down = g.normalized();
    const auto put = [](const Vec3d& gravity, Json& scene) {
      scene["gravity"] = {gravity.x(), gravity.y(), gravity.z()};
    };
    Cause& size =
        add("gravity_size", "outside", "Gravity is {value} stronger than the scene says.");
    size.row.numbers = {number("added", "m/s²", 0.1)};
    size.row.confused_with = {"scale", "frame_rate"};
    // Captures may have scenes of their own: what is added is added to what each of them says.
    size.apply = [down](std::span<const double> v, int, mpm::Scene& scene) {
      for (Vec3d& gravity : scene.gravity.values) gravity += v[0] * down;
    };
    size.write = [g, down, put](std::span<const double> v, int, Json& scene) {
      put(g + v[0] * down, scene);
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
    turn.write = [g, across, along, put](std::span<const double> v, int, Json& scene) {
      put(g + v[0] * across + v[1] * along, scene);
    };
  }

  /// Rows of the catalogue that are terms of the simulation: their strengths (what has a neutral
  /// value) are the numbers, the rest stands at the usual values. Those that need a place have
  /// none.
  void terms() {
    for (const effects::EffectType* type : effects::catalogue()) {
      if (type->way != effects::Way::kTerm || type->find("center")) continue;
      // What is inside a body is measured by its own stiffness: stiffness_causes().
      if (type->group == effects::Group::kMaterial) continue;
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
    cause.apply = [neutral, places](std::span<const double> v, int, mpm::Scene& scene) {
      effects::Effect effect = neutral;
      for (std::size_t k = 0; k < places.size(); ++k) effect.values[places[k]] = v[k];
      scene.effects.push_back(std::move(effect));
    };
    cause.write = [neutral, places](std::span<const double> v, int, Json& scene) {
      effects::Effect effect = neutral;
      for (std::size_t k = 0; k < places.size(); ++k) effect.values[places[k]] = v[k];
      scene["effects"].push_back(effect_entry(effect));
    };
    causes_.push_back(std::move(cause));
  }

  void contact() {
    for (std::size_t c = 0; c < job_.scene.colliders.size(); ++c) {
      const ColliderDoc& doc = job_.scene.colliders[c];
      const shape::Contact contact = scene_.colliders[c]->contact();
      const auto with = [c](auto change) {
        return [c, change](std::span<const double> v, int, mpm::Scene& scene) {
          if (c >= scene.colliders.size()) return;  // not in this capture's own scene
          shape::Contact moved = scene.colliders[c]->contact();
          change(moved, v[0]);
          scene.colliders[c] = mpm::with_contact(scene.colliders[c], moved);
        };
      };
      if (contact.kind == shape::ContactKind::kFriction &&
          !fitted("colliders." + doc.name + ".contact.mu")) {
        Cause& cause = add("friction", "contact", "");
        cause.row.sentence = "The friction coefficient of '" + doc.name + "' differs by {value}.";
        cause.row.numbers = {number("added", "", 0.05)};
        cause.row.numbers[0].low = -contact.mu;
        cause.row.tries = {-0.6 * contact.mu, -0.3 * contact.mu, 0.3 * contact.mu};
        const double mu = contact.mu;
        cause.apply =
            with([](shape::Contact& moved, double v) { moved.mu = std::max(0.0, moved.mu + v); });
        cause.write = [c, mu](std::span<const double> v, int, Json& scene) {
          scene.at("colliders").at(c)["contact"]["mu"] = mu + v[0];
        };
      }
      Cause& bounce = add("restitution", "contact", "");
      bounce.row.sentence =
          "Contact with '" + doc.name + "' loses {value} of critical damping more.";
      const double damping = mpm::contact_damping(contact);
      bounce.row.numbers = {number("damping", "", 0.05)};
      bounce.row.numbers[0].low = -damping;
      bounce.row.confused_with = {"damping_shear", "damping_bulk"};
      bounce.apply = with([](shape::Contact& moved, double v) {
        moved.damping = std::max(0.0, mpm::contact_damping(moved) + v);
      });
      bounce.write = [c, damping](std::span<const double> v, int, Json& scene) {
        scene.at("colliders").at(c)["contact"]["damping"] = damping + v[0];
      };
      if (doc.shape == ColliderDoc::Shape::kGround) ground(c, doc);
    }
  }

  void ground(std::size_t c, const ColliderDoc& doc) {
    Cause& tilt = add("ground_tilt", "contact", "");
    tilt.row.sentence = "'" + doc.name + "' slopes by {value}.";
    tilt.row.numbers = {number("x", "", 0.02), number("y", "", 0.02)};
    tilt.row.confused_with = {"gravity_direction", "camera_roll"};
    const Vec3d foot(body_.center.x(), body_.center.y(), doc.height);
    tilt.apply = [c, foot](std::span<const double> v, int, mpm::Scene& scene) {
      if (c >= scene.colliders.size()) return;
      const shape::ColliderPtr old = scene.colliders[c];
      // Where it lies now, under the body.
      const Vec3d below = foot - Vec3d(0.0, 0.0, old->closest(foot, 0.0).distance);
      scene.colliders[c] = shape::make_plane(old->name(), old->contact(), below,
                                             Vec3d(-v[0], -v[1], 1.0).normalized());
    };
    tilt.write = [c, foot](std::span<const double> v, int, Json& scene) {
      Json& collider = scene.at("colliders").at(c);
      const Vec3d normal = Vec3d(-v[0], -v[1], 1.0).normalized();
      collider["shape"] = "plane";
      collider.erase("height");
      collider["point"] = {foot.x(), foot.y(), foot.z()};
      collider["normal"] = {normal.x(), normal.y(), normal.z()};
    };
  }

  void material() {
    const material::Material& m = scene_.bodies.front().material;
    const double modulus = m.traits().fluid ? m.bulk_modulus : m.youngs_modulus;
    const auto damping = [&](const char* name, double material::Material::*member,
                             const char* sentence) {
      if (fitted(name)) return;
      const double now = m.*member;
      Cause& cause = add(name, "material", sentence);
      cause.row.numbers = {number("added", "Pa s", 1e-3 * modulus, true)};
      cause.row.confused_with = {"drag_linear", "drag_quadratic", "relaxation", "friction"};
      cause.apply = [member](std::span<const double> v, int, mpm::Scene& scene) {
        scene.bodies.front().material.*member += v[0];
      };
      cause.write = [name, now](std::span<const double> v, int, Json& scene) {
        first_body(scene)["material"][name] = now + v[0];
      };
    };
    damping("damping_shear", &material::Material::damping_shear,
            "The material damps: {value} of viscosity against shear.");
    damping("damping_bulk", &material::Material::damping_bulk,
            "The material damps: {value} of viscosity against compression.");
    if (!fitted("maxwell") && m.maxwell.size() < material::kMostMaxwellBranches)
      relaxation(modulus);
  }

  void relaxation(double modulus) {
    Cause& cause =
        add("relaxation", "material", "The material relaxes: a branch of {value} {variant}.");
    cause.row.numbers = {number("modulus", "Pa", 0.1 * modulus, true)};
    cause.row.confused_with = {"damping_shear", "drag_linear", "drag_quadratic"};
    std::vector<double> times;
    for (const double share : kRelaxationShares) {
      times.push_back(share * options_.duration);
      cause.row.variants.push_back(fmt::format("with a time of {:.3g} s", times.back()));
    }
    cause.apply = [times](std::span<const double> v, int variant, mpm::Scene& scene) {
      scene.bodies.front().material.maxwell.push_back(
          {v[0], times[static_cast<std::size_t>(variant)]});
    };
    cause.write = [times](std::span<const double> v, int variant, Json& scene) {
      first_body(scene)["material"]["maxwell"].push_back(
          {{"modulus", v[0]}, {"time", times[static_cast<std::size_t>(variant)]}});
    };
  }

  void masses() {
    if (fitted("masses")) return;
    Cause& cause = add("attached_mass", "state", "A mass of {value} is attached {variant}.");
    const double mass = body_.volume * scene_.bodies.front().density;
    cause.row.numbers = {number("mass", "kg", 0.05 * mass, true)};
    cause.row.confused_with = {"density", "gravity_size"};
    std::vector<Vec3d> places;
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool high : {false, true}) {
        Vec3d place = body_.center;
        place[axis] = high ? body_.high[axis] : body_.low[axis];
        places.push_back(place);
        cause.row.variants.push_back(
            fmt::format("at the end towards {}{}", high ? '+' : '-', "xyz"[axis]));
      }
    }
    places.push_back(body_.center);
    cause.row.variants.emplace_back("at the centre");
    cause.apply = [places](std::span<const double> v, int variant, mpm::Scene& scene) {
      if (!(v[0] > 0.0)) return;
      mpm::AttachedMass attached;
      attached.position = places[static_cast<std::size_t>(variant)];
      attached.mass = v[0];
      scene.bodies.front().masses.push_back(attached);
    };
    cause.write = [places](std::span<const double> v, int variant, Json& scene) {
      const Vec3d& at = places[static_cast<std::size_t>(variant)];
      first_body(scene)["masses"].push_back(
          {{"position", {at.x(), at.y(), at.z()}}, {"mass", v[0]}});
    };
  }

  void motion() {
    const auto vector = [&](const char* name, const char* unit, double scale,
                            Vec3d mpm::Body::*member, const char* sentence) {
      if (fitted(name)) return;
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
    const bool held = !scene_.bodies.front().pins.empty();
    if (held) return;  // what is held and let go has no throw
    vector("velocity", "m/s", 0.05, &mpm::Body::velocity,
           "The body starts {value} faster than the scene says.");
    vector("spin", "rad/s", 0.2, &mpm::Body::spin,
           "The body turns {value} faster at the start than the scene says.");
  }

  void measurement() {
    const auto observation = [&](const char* name, Observation kind, std::vector<Number> numbers,
                                 const char* sentence, std::vector<std::string> confused) {
      Cause& cause = add(name, "measurement", sentence);
      cause.row.observation = kind;
      cause.row.numbers = std::move(numbers);
      cause.row.confused_with = std::move(confused);
      cause.row.pivot = body_.center;
    };
    const double frame = 1.0 / scene_.fps;
    if (!fitted("start_frame")) {
      observation("time_offset", Observation::kTimeOffset, {number("offset", "s", 0.2 * frame)},
                  "The recording begins {value} later than stated.", {"velocity"});
    }
    observation("frame_rate", Observation::kFrameRate, {number("factor", "", 0.01)},
                "The recording runs {value} faster than stated.", {"gravity_size", "scale"});
    observation("scale", Observation::kScale, {number("factor", "", 0.01)},
                "Lengths of the recording are {value} larger than true.",
                {"gravity_size", "frame_rate"});
    observation("camera_drift", Observation::kDrift,
                {number("x", "m/s", 0.01), number("y", "m/s", 0.01), number("z", "m/s", 0.01)},
                "The camera drifts by {value}.", {"velocity", "friction"});
    observation("camera_roll", Observation::kRoll, {number("angle", "rad", 0.01)},
                "The camera is rolled by {value}.", {"gravity_direction", "ground_tilt"});
    observation("tracker_lag", Observation::kLag, {number("time", "s", 0.2 * frame, true)},
                "The tracker lags by {value}.", {"time_offset"});
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
