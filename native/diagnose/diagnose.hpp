// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>

#include "diagnose/model.hpp"
#include "diagnose/report.hpp"

namespace matterfit::diagnose {

struct DiagnoseOptions {
  /// Runs of the solver's ensemble; 0: the solver counts as exact.
  int members = 24;
  /// The rate of false alarms over all causes together. Smaller than the 5 % that are promised: two
  /// more tests (the smooth residual's, the exact solver's) take the rest.
  double level = 0.03;
  /// The level of the smooth residual's test for something unknown.
  double smooth_level = 0.01;
  int draws = 1000;     ///< of the placebo
  bool central = true;  ///< two runs a derivative; one where runs are dear
  int refits = 10;      ///< single causes refitted at most
  int most_causes = 3;  ///< named together
  int iterations = 15;  ///< of a refit
  int most_runs =
      std::numeric_limits<int>::max();  ///< Study::search_work() after which searches end
  int limit = 6000;  ///< rows (coordinates of samples) used, and held out; tracks are left out
  int listed = 12;   ///< causes in the table
  /// What log-likelihood ratios are divided by before they become probabilities: they are of a
  /// covariance and a catalogue that are themselves uncertain. 2 until a benchmark's training seeds
  /// say otherwise.
  double temperature = 2.0;
  double prior_nothing = 0.5;  ///< beforehand; causes share what is left of it and of the unknown
  double prior_unknown = 0.1;
  std::uint64_t seed = 1;
  std::function<void(double, const std::string&)> progress;  ///< fraction, what is being done
};

/// What the simulation gets wrong, why, how sure that is, and what correcting it gains: a score
/// test of every candidate with all fitted parameters projected out, refits of the best, judged on
/// samples that nothing saw (Rao 1948; for deforming bodies with the solver's own error in the
/// null). The same model, options and bits give the same report.
/// Throws Error(kInput) from check(model), Error(kCompute) where the fitted model cannot be
/// simulated, and whatever Model::simulate throws.
[[nodiscard]] Report diagnose(const Model& model, const DiagnoseOptions& options = {});

}  // namespace matterfit::diagnose
