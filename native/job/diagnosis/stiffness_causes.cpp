// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/stiffness_causes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "effects/effect_type.hpp"
#include "job/diagnosis/effect_entry.hpp"
#include "job/diagnosis/extent.hpp"
#include "job/diagnosis/surface_places.hpp"

namespace matterfit::job {
namespace {

using diagnose::Number;

/// How far towards the surface an inclusion lies, along one axis or several, as a share of the way,
/// and its radius, in longest sides: two neighbours overlap by half.
constexpr double kTowardsSurface = 0.6;
constexpr double kRadius = 0.35;
/// In radii: places nearer to each other are one.
constexpr double kSamePlace = 0.35;
/// What may be taken away of the body's own modulus; more and a corner has none.
constexpr double kMostTaken = 0.8;
constexpr double kMostAdded = 20.0;
/// In the body's own modulus: a size at which one would care for it.
constexpr double kScale = 0.2;

class StiffnessCauses {
 public:
  explicit StiffnessCauses(const mpm::Scene& scene)
      : scene_(scene),
        extent_(extent_of(scene.bodies.front())),
        modulus_(scene.bodies.front().material.youngs_modulus),
        nu_(std::clamp(scene.bodies.front().material.poisson_ratio, 0.0, 0.49)) {}

  std::vector<Cause> all() {
    if (scene_.bodies.front().material.traits().fluid || !(modulus_ > 0.0)) return {};
    inclusion();
    gradient();
    fibres();
    stiffening();
    return std::move(causes_);
  }

 private:
  [[nodiscard]] effects::Effect made(const char* name) const {
    effects::Effect effect = effects::make_effect(name);
    effect.body = scene_.bodies.front().name;
    return effect;
  }

  static void set(effects::Effect& effect, const char* key, std::initializer_list<double> values) {
    auto at = effect.values.begin() +
              static_cast<std::ptrdiff_t>(effect.type->offset(*effect.type->find(key)));
    for (const double value : values) *at++ = value;
  }

  /// A cause of which each variant is one of `shapes` and whose numbers are the parameter `key`.
  void add(const char* sentence, std::vector<effects::Effect> shapes,
           std::vector<std::string> variants, const char* key, const Number& number) {
    const effects::EffectType& type = *shapes.front().type;
    const std::size_t parameter = *type.find(key);
    const std::size_t first = type.offset(parameter);
    Cause& cause = causes_.emplace_back();
    cause.row.name = type.name;
    cause.row.scope = "body " + scene_.bodies.front().name;
    cause.row.group = "material";
    cause.row.sentence = sentence;
    cause.row.confused_with = type.confused_with;
    cause.row.variants = std::move(variants);
    const std::size_t count = type.parameters[parameter].size;
    for (std::size_t c = 0; c < count; ++c) {
      Number n = number;
      n.unit = type.parameters[parameter].unit;
      n.name = key + (count > 1 ? "[" + std::to_string(c) + "]" : "");
      cause.row.numbers.push_back(std::move(n));
    }
    const auto with = [shapes = std::move(shapes), first](std::span<const double> v, int variant) {
      effects::Effect effect = shapes[static_cast<std::size_t>(variant)];
      for (std::size_t k = 0; k < v.size(); ++k) effect.values[first + k] = v[k];
      return effect;
    };
    cause.apply = [with](std::span<const double> v, int variant, mpm::Scene& scene) {
      scene.effects.push_back(with(v, variant));
    };
    cause.write = [with](std::span<const double> v, int variant, Json& scene) {
      scene["effects"].push_back(effect_entry(with(v, variant)));
    };
  }

  [[nodiscard]] Number of_modulus(double unit) const {
    Number number;
    number.scale = kScale * unit;
    number.low = -kMostTaken * unit;
    number.high = kMostAdded * unit;
    return number;
  }

  /// A place at the body's centre, or from there towards its surface along some axes.
  [[nodiscard]] Vec3d towards_surface(const std::array<int, 3>& towards) const {
    Vec3d place = extent_.center;
    for (int axis = 0; axis < 3; ++axis) {
      if (towards[std::size_t(axis)] == 0) continue;
      const double end = towards[std::size_t(axis)] > 0 ? extent_.high[axis] : extent_.low[axis];
      place[axis] += kTowardsSurface * (end - place[axis]);
    }
    return place;
  }

  void inclusion() {
    if (has_effect(scene_, "stiffness_inclusion")) return;
    std::vector<effects::Effect> shapes;
    std::vector<std::string> variants;
    const auto place = [&](const Vec3d& center, std::string where) {
      effects::Effect effect = made("stiffness_inclusion");
      set(effect, "center", {center.x(), center.y(), center.z()});
      set(effect, "radius", {kRadius * extent_.size});
      set(effect, "nu", {nu_});
      shapes.push_back(std::move(effect));
      variants.push_back(std::move(where));
    };
    // Places beside each other along an axis in which the body is thin would be one and the same.
    const auto room = [&](int axis) {
      const double side = extent_.high[axis] - extent_.low[axis];
      return 0.5 * kTowardsSurface * side > kSamePlace * kRadius * extent_.size ? 1 : 0;
    };
    const int x = room(0);
    const int y = room(1);
    const int z = room(2);
    for (int i = -x; i <= x; ++i)
      for (int j = -y; j <= y; ++j)
        for (int k = -z; k <= z; ++k) {
          const std::array<int, 3> towards{i, j, k};
          place(towards_surface(towards),
                towards == std::array<int, 3>{} ? "at the centre" : words_of(towards));
        }
    add("Something inside is {value} stiffer {variant} (below 0: softer).", std::move(shapes),
        std::move(variants), "modulus", of_modulus(modulus_));
  }

  void gradient() {
    if (has_effect(scene_, "stiffness_gradient")) return;
    effects::Effect effect = made("stiffness_gradient");
    set(effect, "center", {extent_.center.x(), extent_.center.y(), extent_.center.z()});
    set(effect, "nu", {nu_});
    const double slope = modulus_ / (0.5 * extent_.size);
    Number number = of_modulus(slope);
    number.high = kMostTaken * slope;
    add("The body is stiffer towards one side: {value}.", {std::move(effect)}, {}, "slope", number);
  }

  void fibres() {
    if (has_effect(scene_, "fibres")) return;
    std::vector<effects::Effect> shapes;
    std::vector<std::string> variants;
    for (int axis = 0; axis < 3; ++axis) {
      effects::Effect& effect = shapes.emplace_back(made("fibres"));
      const Vec3d along = Vec3d::Unit(axis);
      set(effect, "direction", {along.x(), along.y(), along.z()});
      variants.push_back(fmt::format("along {}", "xyz"[axis]));
    }
    Number number = of_modulus(modulus_);
    number.one_sided = true;
    number.low = 0.0;
    add("The material is {value} stiffer {variant}, as fibres make it.", std::move(shapes),
        std::move(variants), "modulus", number);
  }

  void stiffening() {
    if (has_effect(scene_, "strain_stiffening")) return;
    Number number = of_modulus(modulus_);
    number.low = -kScale * modulus_;
    add("The material stiffens by {value} when stretched far.", {made("strain_stiffening")}, {},
        "modulus", number);
  }

  const mpm::Scene& scene_;
  Extent extent_;
  double modulus_;
  double nu_;
  std::vector<Cause> causes_;
};

}  // namespace

std::vector<Cause> stiffness_causes(const mpm::Scene& scene) {
  return StiffnessCauses(scene).all();
}

}  // namespace matterfit::job
