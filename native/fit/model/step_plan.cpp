// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/step_plan.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "mpm/step_limit.hpp"

namespace matterfit::fit {
namespace {

/// The share of the solver's margin (dt_safety) that values beside the ones whose substeps are
/// taken may use.
constexpr double kMargin = 1.1;
/// Steps in which substeps are made more or fewer: a quarter of an octave.
constexpr double kFiner = 1.189207115002721;
/// A factor of 32.
constexpr int kMostFiner = 20;
/// So many steps fewer are worth another sequence of substeps: half of them.
constexpr int kWorthCoarser = 4;

/// How often the substeps are multiplied by kFiner (negative: divided) for a limit of stability.
int steps_finer(const RunSteps& steps, double limit, double margin) {
  if (!(limit > 0.0) || !std::isfinite(limit)) return 0;
  return static_cast<int>(std::ceil(std::log(steps.limit / limit / margin) / std::log(kFiner)));
}

}  // namespace

double StepPlan::factor(std::size_t run, const mpm::Scene& scene) const {
  const int finer =
      std::max(refinements[run], steps_finer(runs[run], mpm::step_limit(scene), kMargin));
  if (finer > kMostFiner) {
    throw_compute("the values ask for more than 32 times the substeps of where the search began.");
  }
  return std::pow(kFiner, finer);
}

void StepPlan::settle(std::size_t run, const mpm::Scene& scene, const int* before) {
  // The steps of the differences beside these values go without more substeps.
  const int asked = steps_finer(runs[run], mpm::step_limit(scene), 0.95 * kMargin);
  const bool keep = before != nullptr && asked < *before && asked > *before - kWorthCoarser;
  refinements[run] = keep ? *before : asked;
}

std::vector<int> with_neighbours(const std::vector<int>& substeps) {
  std::vector<int> result = substeps;
  for (std::size_t f = 0; f + 1 < substeps.size(); ++f) {
    result[f] = std::max(result[f], substeps[f + 1]);
    result[f + 1] = std::max(result[f + 1], substeps[f]);
  }
  return result;
}

std::vector<int> multiplied(const std::vector<int>& substeps, double factor) {
  std::vector<int> result;
  result.reserve(substeps.size());
  for (const int count : substeps) {
    result.push_back(std::max(1, static_cast<int>(std::ceil(factor * count - 1e-9))));
  }
  return result;
}

}  // namespace matterfit::fit
