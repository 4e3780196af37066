// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "fit/numerics/parameter.hpp"
#include "job/documents/fit_document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// A scene that a fit simulates: the document's and, built of it, the solver's at the document's
/// resolution.
struct FitScene {
  const Job* job = nullptr;
  const mpm::Scene* scene = nullptr;
  std::vector<std::string> captures;  ///< whose own scene it is; empty: the document's
  Json overrides;                     ///< of a scene of its own; null: none
};

/// The numbers that a fit moves, in the order of `fit.parameters` with vectors taken apart, and how
/// to put them into a scene or a document. A quantity of a scene is moved by one number: where a
/// capture's own scene has one of its own, by that.
class FitParameters {
 public:
  /// Throws Error(kInput) beginning with the entry's path for a start or bounds that do not go, for
  /// a scene that has no such quantity, and for two numbers for one quantity of a scene.
  FitParameters(const std::vector<FitParameterDoc>& docs, const std::vector<FitScene>& scenes);

  [[nodiscard]] std::size_t size() const { return numbers_.size(); }
  /// Names, units, bounds, starts (physical); of each number.
  [[nodiscard]] const std::vector<fit::Parameter>& parameters() const { return parameters_; }
  [[nodiscard]] const FitPath& path(std::size_t number) const { return numbers_[number].path; }
  [[nodiscard]] bool acts_on(std::size_t number, std::size_t scene) const {
    return numbers_[number].scenes[scene] != 0;
  }
  [[nodiscard]] std::vector<double> starts() const;
  /// Bodies of a scene whose material is moved.
  [[nodiscard]] std::vector<std::string> moved_materials(std::size_t scene) const;
  /// Whether the body is placed anew, so that points must be bound to it again.
  [[nodiscard]] bool places(std::size_t scene, const std::string& body) const;

  /// Sets the values in a scene that was built at any resolution.
  void apply(std::span<const double> values, std::size_t scene, mpm::Scene& into) const;
  /// Where a point that is given on the model is after the body was placed anew.
  [[nodiscard]] Vec3d placed(std::span<const double> values, std::size_t scene,
                             const std::string& body, const Vec3d& point) const;
  /// By how much later than the document says a capture begins [s].
  [[nodiscard]] double delay(std::span<const double> values, std::size_t scene,
                             const std::string& capture) const;
  /// Sets the values in the job's document, `captures[].scene` included.
  void write(std::span<const double> values, const Job& job, Json& document) const;

 private:
  struct Number {
    FitPath path;  ///< of a vector one component
    std::string where;
    std::vector<std::uint8_t> scenes;  ///< 1: acts on it
  };
  struct Placing {
    bool moves = false;
    Vec3d pivot = Vec3d::Zero();  ///< the document's position
    Vec3d shift = Vec3d::Zero();
    Quatd turn = Quatd::Identity();
    [[nodiscard]] Vec3d operator()(const Vec3d& x) const {
      return turn * (x - pivot) + pivot + shift;
    }
  };

  void add(const FitParameterDoc& doc, std::size_t component, const std::vector<FitScene>& scenes);
  /// Leaves each quantity of each scene to one number.
  void settle_overlaps();
  /// All three components of a vector, those that are not fitted as the scene has them.
  [[nodiscard]] Vec3d vector_of(std::span<const double> values, std::size_t scene,
                                const FitPath& path) const;
  [[nodiscard]] Placing placing(std::span<const double> values, std::size_t scene,
                                const std::string& body) const;

  std::vector<Number> numbers_;
  std::vector<fit::Parameter> parameters_;
  std::vector<FitScene> scenes_;
};

}  // namespace matterfit::job
