// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/value_errors.hpp"

#include <cstddef>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

/// Whether the path is of a capture of which the fit sees nothing.
bool is_unseen(const Address& path, const std::vector<Run>& runs) {
  const bool own = path.quantity->owner == Owner::kCapture;
  const std::string& name = own ? path.owner : path.capture;
  if (name.empty()) return false;
  for (const Run& run : runs) {
    for (const Capture& capture : run.captures) {
      if (capture.input.name == name) return capture.used_count == 0;
    }
  }
  return false;
}

/// The residuals of the last stage at its end, on the coarser grid.
Eigen::VectorXd coarser(SearchProblems& problems, const SearchStage& stage, const LawState& state) {
  const double level = kCoarser * stage.level;
  const std::vector<std::vector<double>> here{state.values};
  const Evaluation found = problems.model(level).evaluate(here, {stage.window.until});
  if (!found.outcomes.front()) throw_compute(found.failure.message);
  return problems.problem(level, stage.window).residuals(*found.outcomes.front());
}

}  // namespace

std::optional<Eigen::VectorXd> grid_change(const Eigen::VectorXd& fine,
                                           const std::function<Eigen::VectorXd()>& residuals,
                                           std::vector<std::string>& statements) {
  try {
    return residuals() - fine;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kInput && error.kind() != ErrorKind::kCompute) throw;
    statements.push_back(
        std::string("What the grid makes of the values is not known: with a larger particle "
                    "separation the scene could not be simulated (") +
        error.what() + ")");
    return std::nullopt;
  }
}

Uncertainty errors_of_values(SearchProblems& problems, const SearchStage& stage,
                             const CaptureProblem& problem,
                             const std::vector<Parameter>& parameters, const LawState& at_end,
                             bool far, std::vector<std::string>& statements) {
  const LeastSquaresState& search = *at_end.search;
  Uncertainty known = uncertainty(parameters, search, problem.effective(search.residual),
                                  problems.setup().options.huber, problem.blocks(), far);
  for (std::size_t k = 0; k < known.estimates.size(); ++k) {
    if (known.estimates[k].observable || !is_unseen(problems.parameters().path(k), problems.runs()))
      continue;
    known.estimates[k].statement = parameters[k].name +
                                   " is not observed: the fit sees nothing of its capture, which "
                                   "is held out or outside of the scene's frames. It keeps its "
                                   "start value.";
  }
  const auto change = grid_change(
      search.residual, [&] { return coarser(problems, stage, at_end); }, statements);
  if (change) {
    add_grid_error(parameters, search, *change, kOfCoarser, problems.setup().options.huber, known);
  }
  return known;
}

}  // namespace matterfit::fit
