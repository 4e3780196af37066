// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::shape {

/// Rigid placement: x_world = rotation · x_local + position.
struct Pose {
  Vec3d position = Vec3d::Zero();
  Quatd rotation = Quatd::Identity();
};

[[nodiscard]] inline double interpolate(double a, double b, double t) { return a + (b - a) * t; }
[[nodiscard]] inline Vec3d interpolate(const Vec3d& a, const Vec3d& b, double t) {
  return a + (b - a) * t;
}
[[nodiscard]] inline Pose interpolate(const Pose& a, const Pose& b, double t) {
  return {a.position + (b.position - a.position) * t, a.rotation.slerp(t, b.rotation)};
}

/// A quantity that may be keyed. `times` are seconds after the scene's first frame, ascending;
/// before the first and after the last key the value is held.
template <class Value>
struct Keyed {
  std::vector<double> times;
  std::vector<Value> values;
  bool step = false;  ///< hold each value until the next key, in place of linear interpolation

  Keyed() = default;
  explicit Keyed(Value value) : times{0.0}, values{std::move(value)} {}

  [[nodiscard]] bool empty() const { return values.empty(); }
  [[nodiscard]] bool animated() const { return values.size() > 1; }
  /// Value at `time` [s]. Must not be empty.
  [[nodiscard]] Value at(double time) const {
    const auto after = std::upper_bound(times.begin(), times.end(), time);
    if (after == times.begin()) return values.front();
    const auto i = static_cast<std::size_t>(after - times.begin()) - 1;
    if (step || i + 1 == times.size()) return values[i];
    return interpolate(values[i], values[i + 1], (time - times[i]) / (times[i + 1] - times[i]));
  }
};

}  // namespace matterfit::shape
