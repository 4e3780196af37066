// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "effects/effect.hpp"
#include "effects/term.hpp"

namespace matterfit::effects {

/// The coordinate in which a parameter is fitted.
enum class Coordinate {
  kLinear,
  kLog,  ///< of values above 0
};

/// A number of an effect, or a vector of three.
struct EffectParameter {
  std::string key;   ///< in documents, snake_case
  std::string unit;  ///< "" where it has none
  std::size_t size = 1;
  /// In a new effect, `size` of them; empty: documents must give it.
  std::vector<double> standard;
  /// Where all components have this value the whole effect does nothing.
  std::optional<double> neutral;
  double low = 0.0;  ///< bounds of each component
  double high = 0.0;
  double scale = 1.0;  ///< a natural size of a change
  Coordinate coordinate = Coordinate::kLinear;
  bool may_be_keyed = false;
  std::string label;     ///< for people
  std::string sentence;  ///< what it is
};

/// What an effect belongs to.
enum class Scope {
  kShared,   ///< one for the scene, or for a body that it names
  kBody,     ///< of one body
  kCapture,  ///< of one recording
  kCamera,
};

/// How an effect comes into a simulation.
enum class Way {
  kTerm,      ///< `make` gives a Term for each body
  kQuantity,  ///< the scene has its numbers already: `quantities` names their paths
};

enum class Group { kOutside, kContact, kMaterial, kState, kMeasurement };

/// A row of the catalogue of model extensions.
struct EffectType {
  std::string name;  ///< snake_case: part of the interface, in documents, reports and the panel
  Group group = Group::kOutside;
  Scope scope = Scope::kShared;
  Way way = Way::kTerm;
  std::vector<EffectParameter> parameters;  ///< of a term
  std::vector<std::string> quantities;      ///< document paths of the scene's own numbers
  std::string signature;                    ///< what it does to the residual, a sentence
  std::vector<std::string> confused_with;   ///< names of rows
  std::string sentence;                     ///< what it is, for people
  /// The row to which it adds: it stands beside one of that, by the numbers that both have.
  std::string beside = {};
  /// The term on a body; the effect lives as long. Null where `way` is another.
  std::unique_ptr<Term> (*make)(const Effect& effect, const BodyFacts& body) = nullptr;
  /// What an effect adds to the inertia of a body, not to its weight [kg/m³ of its volume], and its
  /// adjoint. Null: nothing.
  double (*added_density)(const Effect& effect) = nullptr;
  void (*added_density_adjoint)(const Effect& effect, double density_bar, double* values) = nullptr;

  /// Numbers of all parameters together.
  [[nodiscard]] std::size_t size() const;
  /// Place of a parameter's first number in Effect::values.
  [[nodiscard]] std::size_t offset(std::size_t parameter) const;
  /// The parameter with this key, or none.
  [[nodiscard]] std::optional<std::size_t> find(std::string_view key) const;
};

}  // namespace matterfit::effects
