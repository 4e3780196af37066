// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "fit/numerics/least_squares.hpp"

/// Problems for the tests of this room.
namespace matterfit::fit {

/// Residuals by a function of the natural coordinates.
class FunctionProblem : public Problem {
 public:
  using Function = std::function<std::optional<Eigen::VectorXd>(const Eigen::VectorXd&)>;
  explicit FunctionProblem(Function function) : function_(std::move(function)) {}
  std::vector<std::optional<Eigen::VectorXd>> evaluate(
      const std::vector<Eigen::VectorXd>& points) override {
    if (batches++ >= last_batch) throw Error(ErrorKind::kCancelled, "cancelled");
    evaluations += int(points.size());
    std::vector<std::optional<Eigen::VectorXd>> results;
    results.reserve(points.size());
    for (const Eigen::VectorXd& x : points) results.push_back(function_(x));
    return results;
  }
  int batches = 0;
  int evaluations = 0;
  int last_batch = std::numeric_limits<int>::max();  ///< after so many it is cancelled
  Problem* cheaper = nullptr;
  Problem* stand_in() override { return cheaper; }

 private:
  Function function_;
};

inline std::vector<Parameter> linear_parameters(const std::vector<double>& start, double low = -1e3,
                                                double high = 1e3) {
  std::vector<Parameter> parameters;
  for (const double x : start) {
    Parameter parameter;
    parameter.name = "x[" + std::to_string(parameters.size()) + "]";
    parameter.start = x;
    parameter.low = low;
    parameter.high = high;
    parameters.push_back(parameter);
  }
  return parameters;
}

/// Options that go to the last digits of a smooth function.
inline LeastSquaresOptions exact() {
  LeastSquaresOptions options;
  options.iterations = 300;
  options.step_tolerance = 1e-10;
  options.cost_tolerance = 1e-18;
  options.difference = 1e-6;
  return options;
}

/// Minimum 0 at (1, 1), at the end of a narrow curved valley.
inline std::optional<Eigen::VectorXd> rosenbrock(const Eigen::VectorXd& x) {
  return Eigen::VectorXd(Eigen::Vector2d(10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]));
}

inline LeastSquaresState run(const LeastSquares& fit, Problem& problem) {
  LeastSquaresState state = fit.start();
  while (!state.finished) fit.iterate(problem, state);
  return state;
}

}  // namespace matterfit::fit
