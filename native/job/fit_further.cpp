// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_further.hpp"

#include <algorithm>
#include <utility>

#include "job/fit_report.hpp"

namespace matterfit::job {
namespace {

/// So many steps that predict worse end the search.
constexpr int kMostWorse = 4;

Json both(const std::optional<double>& without, const std::optional<double>& with) {
  const auto number = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json();
  };
  return {{"without", number(without)}, {"with", number(with)}};
}

}  // namespace

bool is_nearer(const FurtherMeans& now, const FurtherMeans& best) {
  return best.held ? now.held && *now.held < *best.held : now.seen && *now.seen < *best.seen;
}

FurtherMeans means_of(fit::LawFit& fit, const fit::LawState& state) {
  std::string failure;
  const auto errors = errors_of(fit, state, true, failure);
  if (!errors) return {};
  return {errors->mean(true), errors->mean(false)};
}

Json further_report(const std::string& body, bool taken, int iterations, int evaluations,
                    const FurtherMeans& without, const FurtherMeans& with) {
  return {{"body", body},
          {"taken", taken},
          {"iterations", iterations},
          {"evaluations", evaluations},
          {"held_out_mm", both(without.held, with.held)},
          {"fitted_mm", both(without.seen, with.seen)}};
}

FurtherFit go_on(FurtherStart from, std::vector<fit::ParameterSpec> more, double least_gain,
                 const Interrupter& interrupter, std::vector<std::string>& statements,
                 std::vector<Json>& history) {
  for (fit::ParameterSpec& spec : more) from.setup.parameters.push_back(std::move(spec));
  FurtherFit result;
  result.fit = std::make_unique<fit::LawFit>(std::move(from.setup), interrupter, statements);
  fit::LawFit& fit = *result.fit;
  fit.report = std::move(from.tell);
  const fit::LawState& before = from.before;
  std::vector<double> values = fit.start().values;
  std::copy(before.values.begin(), before.values.end(), values.begin());
  fit::LawState state = fit.at_last_stage(std::move(values));
  const FurtherMeans without = means_of(fit, state);
  const bool judged = without.held.has_value();
  FurtherMeans best = without;
  fit::LawState nearest;
  int worse = 0;
  while (without.seen && !state.finished() && state.iterations < from.iterations &&
         worse < kMostWorse) {
    const int known = state.iterations;
    advance(fit, state, history);
    if (state.iterations == known) continue;
    const FurtherMeans now = means_of(fit, state);
    const bool nearer = judged ? now.held && *now.held < *best.held : now.seen.has_value();
    worse = nearer ? 0 : worse + 1;
    if (!nearer) continue;
    best = now;
    nearest = state;
  }
  result.taken =
      !nearest.values.empty() && (!judged || *best.held < (1.0 - least_gain) * *without.held);
  if (result.taken) {
    result.state = std::move(nearest);
    result.state.iterations = before.iterations + state.iterations;
    result.state.evaluations = before.evaluations + state.evaluations;
    result.state.phase = before.phase;
    result.state.statements = before.statements;
  }
  result.report =
      further_report(from.body, result.taken, state.iterations, state.evaluations, without, best);
  return result;
}

}  // namespace matterfit::job
