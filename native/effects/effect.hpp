// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "shape/keyed.hpp"

namespace matterfit::effects {

struct EffectType;

/// One effect of a scene: a row of the catalogue with its numbers.
struct Effect {
  const EffectType* type = nullptr;  ///< never null in a checked scene
  std::string name;                  ///< unique in the scene
  std::string body;                  ///< the one it acts on; empty: all
  /// The type's parameters, one after another; a vector takes three. EffectType::offset().
  std::vector<double> values;
  /// Empty, or one for each of `values`: what replaces it over time where it has keys [s after the
  /// scene's first frame].
  std::vector<shape::Keyed<double>> keys;

  [[nodiscard]] bool keyed(std::size_t k) const { return !keys.empty() && !keys[k].empty(); }
  [[nodiscard]] double at(std::size_t k, double time) const {
    return keyed(k) ? keys[k].at(time) : values[k];
  }
  [[nodiscard]] Vec3d vector_at(std::size_t k, double time) const {
    return {at(k, time), at(k + 1, time), at(k + 2, time)};
  }
  /// The largest size of a value, or of a vector, at any time.
  [[nodiscard]] double largest(std::size_t k) const;
  [[nodiscard]] double largest_vector(std::size_t k) const;
};

/// Adds a vector to three numbers one after another, as an effect's values are.
inline void add_vector(const Vec3d& vector, double* values) {
  for (std::size_t c = 0; c < 3; ++c) values[c] += vector[static_cast<int>(c)];
}

/// An effect of this type with the parameters' standard values, called like the type. Throws
/// Error(kInput) for an unknown type, with the nearest name.
[[nodiscard]] Effect make_effect(const std::string& type);

/// True where the effect's numbers make it do nothing, at any time: then it is not called.
[[nodiscard]] bool is_neutral(const Effect& effect);

/// Throws Error(kInput), beginning with `where`, for numbers that are missing, not finite or out of
/// the type's bounds.
void check_effect(const Effect& effect, const std::string& where);

}  // namespace matterfit::effects
