// SPDX-License-Identifier: GPL-3.0-or-later
// A vortex around an axis n through c: f = m a s (n × d/r) (1 − q²)³ with d the way from the axis
// and q = |d|/r < 1. s = √7 (7/6)³ makes a the largest acceleration, which is at r/√7.
#include <algorithm>
#include <cmath>

#include "effects/fade.hpp"
#include "effects/rows.hpp"

namespace matterfit::effects {
namespace {

enum Value : std::size_t { kCenter = 0, kAxis = 3, kRadius = 6, kStrength = 7 };

class Vortex final : public Term {
 public:
  explicit Vortex(const Effect& effect) : effect_(effect) {}

  [[nodiscard]] Vec3d force(const MaterialPoint& point, const Moment& moment) const override {
    const Place at = place(point, moment.time);
    return point.mass * effect_.at(kStrength, moment.time) * at.share * at.around;
  }
  void force_adjoint(const MaterialPoint& point, const Moment& moment, const Vec3d& force_bar,
                     MaterialPointBar& bar, double* values) const override {
    const Place at = place(point, moment.time);
    const double a = effect_.at(kStrength, moment.time);
    const double along = force_bar.dot(at.around);
    bar.mass += a * at.share * along;
    values[kStrength] += point.mass * at.share * along;
    // f = m a share (n × way), way = d/r, share = s (1 − q²)³.
    const double radius = at.fade.radius;
    const Fade::Bar faded = at.fade.adjoint(kPeak * point.mass * a * along);
    const Vec3d around_bar = point.mass * a * at.share * force_bar;
    Vec3d normal_bar = at.fade.away.cross(around_bar) / radius;
    values[kRadius] += faded.radius - around_bar.dot(at.around) / radius;
    // d = e − n (n·e), e the way from the centre: n × d = n × e.
    const Vec3d away_bar = faded.away + around_bar.cross(at.normal) / radius;
    const Vec3d whole_bar = away_bar - at.normal.dot(away_bar) * at.normal;
    normal_bar -= at.normal.dot(away_bar) * at.whole + at.normal.dot(at.whole) * away_bar;
    const Vec3d axis_bar = (normal_bar - at.normal.dot(normal_bar) * at.normal) / at.length;
    bar.position += whole_bar;
    add_vector(-whole_bar, values + kCenter);
    add_vector(axis_bar, values + kAxis);
  }
  [[nodiscard]] double acceleration_bound(double /*speed*/) const override {
    return effect_.largest(kStrength);
  }

 private:
  static constexpr double kPeak = 4.201355;  ///< √7 (7/6)³
  struct Place {
    Vec3d normal;   ///< along the axis, a unit vector
    double length;  ///< of the axis as it is given
    Vec3d whole;    ///< from the centre [m]
    Vec3d around;   ///< n × d/r
    Fade fade;      ///< with the way from the axis
    double share;   ///< s (1 − q²)³
  };
  [[nodiscard]] Place place(const MaterialPoint& point, double time) const {
    const Vec3d axis = effect_.vector_at(kAxis, time);
    const double length = axis.norm();
    const Vec3d normal = length > 0.0 ? Vec3d(axis / length) : Vec3d::UnitZ();
    const Vec3d whole = point.position - effect_.vector_at(kCenter, time);
    const Fade fade(whole - normal.dot(whole) * normal, effect_.at(kRadius, time));
    return {.normal = normal,
            .length = std::max(length, 1e-12),
            .whole = whole,
            .around = normal.cross(fade.away) / fade.radius,
            .fade = fade,
            .share = kPeak * fade.left * fade.left * fade.left};
  }

  const Effect& effect_;
};

}  // namespace

const EffectType& vortex() {
  static const EffectType row = {
      .name = "vortex",
      .group = Group::kOutside,
      .scope = Scope::kShared,
      .parameters = {{.key = "center",
                      .unit = "m",
                      .size = 3,
                      .standard = {0.0, 0.0, 0.0},
                      .neutral = std::nullopt,
                      .low = -1e6,
                      .high = 1e6,
                      .scale = 0.1,
                      .may_be_keyed = true,
                      .label = "Centre",
                      .sentence = "A point of its axis"},
                     {.key = "axis",
                      .unit = "",
                      .size = 3,
                      .standard = {0.0, 0.0, 1.0},
                      .neutral = std::nullopt,
                      .low = -1e6,
                      .high = 1e6,
                      .scale = 0.1,
                      .may_be_keyed = true,
                      .label = "Axis",
                      .sentence = "The direction that it turns about, right-handed"},
                     {.key = "radius",
                      .unit = "m",
                      .standard = {1.0},
                      .neutral = std::nullopt,
                      .low = 1e-4,
                      .high = 1e6,
                      .scale = 0.5,
                      .coordinate = Coordinate::kLog,
                      .may_be_keyed = true,
                      .label = "Radius",
                      .sentence = "Where it has faded away, from the axis"},
                     {.key = "strength",
                      .unit = "m/s²",
                      .standard = {0.0},
                      .neutral = 0.0,
                      .low = -1e5,
                      .high = 1e5,
                      .scale = 1.0,
                      .may_be_keyed = true,
                      .label = "Strength",
                      .sentence = "The largest acceleration, at .38 of the radius"}},
      .quantities = {},
      .signature = "The measured body is turned about an axis of the world that it passes.",
      .confused_with = {"force_field", "wind", "spin"},
      .sentence = "Something stirs around an axis and carries along what comes near.",
      .make = [](const Effect& effect, const BodyFacts& /*body*/) -> std::unique_ptr<Term> {
        return std::make_unique<Vortex>(effect);
      }};
  return row;
}

}  // namespace matterfit::effects
