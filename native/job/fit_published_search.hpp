// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fit/model/experiment.hpp"
#include "job/fit_further.hpp"
#include "material/neural/published_material.hpp"
#include "material/neural/published_weights.hpp"

namespace matterfit::job {

/// A fit beside whose own numbers the published law of one body moves along directions.
class PublishedSteps {
 public:
  PublishedSteps() = default;
  PublishedSteps(const PublishedSteps&) = delete;
  PublishedSteps& operator=(const PublishedSteps&) = delete;
  virtual ~PublishedSteps() = default;

  /// From here on along the law's directions, from its weights and these values of its own numbers.
  virtual void begin(std::shared_ptr<const material::PublishedLaw> law,
                     const std::vector<double>& values) = 0;
  /// How far it is off at the values it has come to: the less the better, in any unit.
  [[nodiscard]] virtual FurtherMeans means() = 0;
  /// Takes so many steps at most; how many were accepted.
  virtual int steps(int most) = 0;
  /// Its own numbers, then the moves along the directions.
  [[nodiscard]] virtual const std::vector<double>& values() const = 0;
  /// The derivatives of what it minimises by the weights where it has come to; empty: not known.
  [[nodiscard]] virtual std::vector<double> slope() = 0;
  /// Simulations since begin().
  [[nodiscard]] virtual int evaluations() const = 0;
};

/// What a search of weights has come to.
struct PublishedFound {
  bool taken = false;                  ///< it is nearer than where it began
  material::PublishedWeights weights;  ///< the best
  std::vector<double> values;          ///< of the fit's own numbers, with them
  int steps = 0;
  int evaluations = 0;
  FurtherMeans without;
  FurtherMeans best;
};

/// Moves all weights of a published law, beside a fit's own numbers: Levenberg–Marquardt in a few
/// directions at a time (Narkiss and Zibulevsky 2005, sequential subspace optimisation): each net's
/// stress or flow without and with change of volume, and the strains that it answers to, as
/// factors; the steepest descent of each net in units of each matrix's size; and the last moves.
/// Nearer is what is held out, or without that what is fitted.
[[nodiscard]] PublishedFound search_published(PublishedSteps& of,
                                              const material::PublishedLaw& start,
                                              std::vector<double> values, int iterations);

/// The builder's scenes with a law on the body, its moves 0.
[[nodiscard]] fit::SceneBuilder with_published(fit::SceneBuilder build, std::string body,
                                               std::shared_ptr<const material::PublishedLaw> law);

}  // namespace matterfit::job
