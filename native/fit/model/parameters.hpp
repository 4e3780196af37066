// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "fit/model/experiment.hpp"
#include "fit/model/quantity.hpp"
#include "fit/numerics/parameter.hpp"
#include "mpm/scene.hpp"

namespace matterfit::fit {

/// A quantity that is to be fitted, and what is said of it.
struct ParameterSpec {
  struct Prior {
    std::vector<double> mean;  ///< physical, one a component
    double sigma = 1.0;        ///< physical for linear coordinates, else relative
  };
  std::string where;  ///< in a document, for messages: "fit.parameters[0]"
  Address path;
  std::vector<double> start;                    ///< one a component; empty: the scene's value
  std::optional<std::array<double, 2>> bounds;  ///< physical; none: the usual ones
  std::optional<Prior> prior;
  /// The quantity may be 0, where its usual coordinate cannot be: it is moved linearly and upwards
  /// from the scene's value, with its usual start as scale and as the width of a prior there.
  bool from_zero = false;
};

/// The numbers that a fit moves, in the order of the specs with vectors taken apart, and how to put
/// them into a scene. A quantity of a scene is moved by one number: where a capture's own scene has
/// one of its own, by that.
class Parameters {
 public:
  /// `runs` are borrowed; `scenes`, one a run, are looked at only here and are those of level 1.
  /// Throws Error(kInput) beginning with the spec's `where` for a start or bounds that do not go,
  /// for a scene that has no such quantity, and for two numbers for one quantity of a scene.
  Parameters(const std::vector<ParameterSpec>& specs, const std::vector<Run>& runs,
             const std::vector<mpm::Scene>& scenes);

  [[nodiscard]] std::size_t size() const { return numbers_.size(); }
  /// Names, units, bounds, starts (physical); of each number.
  [[nodiscard]] const std::vector<Parameter>& parameters() const { return parameters_; }
  [[nodiscard]] const Address& path(std::size_t number) const { return numbers_[number].path; }
  [[nodiscard]] bool acts_on(std::size_t number, std::size_t run) const {
    return numbers_[number].runs[run] != 0;
  }
  [[nodiscard]] std::vector<double> starts() const;
  /// Bodies of a scene whose material is moved.
  [[nodiscard]] std::vector<std::string> moved_materials(std::size_t run) const;
  /// Whether the body is placed anew, so that points must be bound to it again.
  [[nodiscard]] bool places(std::size_t run, const std::string& body) const;

  /// Sets the values in a scene as it was built, at any resolution.
  void apply(std::span<const double> values, std::size_t run, mpm::Scene& into) const;
  /// A body of that name as the values place it: its particles may be any points that are given on
  /// the model.
  [[nodiscard]] mpm::Body placed(std::span<const double> values, std::size_t run,
                                 mpm::Body body) const;
  /// How a capture of the run is looked at.
  [[nodiscard]] Viewing viewing(std::span<const double> values, std::size_t run,
                                std::size_t capture) const;
  /// The same of a recording by images.
  [[nodiscard]] Viewing film_viewing(std::span<const double> values, std::size_t run,
                                     std::size_t film) const;

 private:
  struct Number {
    Address path;  ///< of a vector one component
    std::string where;
    std::vector<std::uint8_t> runs;  ///< 1: acts on it
  };
  /// A quantity of a scene with those of its components that numbers set.
  struct Write {
    Address at;
    std::vector<std::pair<std::size_t, std::size_t>> parts;  ///< number, component
  };

  [[nodiscard]] Viewing viewing(std::span<const double> values, std::size_t run,
                                const std::string& name, Viewing viewing) const;
  void add(const ParameterSpec& spec, std::size_t component, const std::vector<mpm::Scene>& scenes);
  /// Leaves each quantity of each scene to one number.
  void settle_overlaps();
  void gather_writes();
  static void apply(const Write& write, std::span<const double> values, const Origins& origins,
                    mpm::Scene& into);

  const std::vector<Run>& runs_;
  std::vector<Number> numbers_;
  std::vector<Parameter> parameters_;
  std::vector<std::vector<Write>> writes_;  ///< of each run
};

}  // namespace matterfit::fit
