// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/quadratic_model.hpp"

#include <algorithm>
#include <cmath>

namespace matterfit::fit {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Longest step of a coordinate that is not linear: a factor ten. A far trial may take a hundred
/// times as long to simulate, and is seldom better.
constexpr double kLongest = 2.302585092994046;
/// Each step is held by a spring, as a prior of this many scales about the present point: what the
/// data know no better than that stays, however low the damping. The noise is that of the fit.
constexpr double kHeldWithin = 30.0;

}  // namespace

double cost_of(const std::vector<Parameter>& parameters, const VectorXd& point,
               const VectorXd& residual, double huber) {
  double sum = 0.0;
  for (const double r : residual) {
    const double size = std::abs(r);
    sum += huber > 0.0 && size > huber ? huber * (2.0 * size - huber) : r * r;
  }
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (!parameters[k].prior) continue;
    const double r = (point[Index(k)] - parameters[k].prior->mean) / parameters[k].prior->sigma;
    sum += r * r;
  }
  return 0.5 * sum;
}

double mean_square(const LeastSquaresState& state) {
  Index observed = 0;
  for (Index i = 0; i < state.residual.size(); ++i) observed += is_observed(state, i) ? 1 : 0;
  return 2.0 * state.cost / double(std::max<Index>(1, observed));
}

QuadraticModel model_of(const std::vector<Parameter>& parameters, const LeastSquaresState& state,
                        double huber) {
  MatrixXd jacobian = state.jacobian;
  VectorXd residual = state.residual;
  if (huber > 0.0) {
    for (Index i = 0; i < residual.size(); ++i) {
      const double size = std::abs(residual[i]);
      if (size <= huber) continue;
      const double root = std::sqrt(huber / size);
      residual[i] *= root;
      jacobian.row(i) *= root;
    }
  }
  const Index n = jacobian.cols();
  QuadraticModel model{MatrixXd(n, n), VectorXd(n), VectorXd::Zero(n), VectorXd::Zero(n)};
  // Column by column: the sums do not depend on the machine's caches as a blocked product does.
  for (Index i = 0; i < n; ++i) {
    model.gradient[i] = jacobian.col(i).dot(residual);
    for (Index j = 0; j <= i; ++j) {
      model.hessian(i, j) = model.hessian(j, i) = jacobian.col(i).dot(jacobian.col(j));
    }
  }
  for (Index k = 0; k < n; ++k) {
    const Parameter& parameter = parameters[std::size_t(k)];
    if (state.unknown[std::size_t(k)] != 0) continue;
    if (parameter.prior) {
      const double weight = 1.0 / (parameter.prior->sigma * parameter.prior->sigma);
      model.hessian(k, k) += weight;
      model.gradient[k] += weight * (state.point[k] - parameter.prior->mean);
    }
  }
  const double variance = mean_square(state);
  for (Index k = 0; k < n; ++k) {
    if (!(model.hessian(k, k) > 0.0)) continue;
    const double held = kHeldWithin * parameters[std::size_t(k)].scale;
    model.scaling[k] = model.hessian(k, k);
    model.spring[k] = variance / (held * held);
  }
  return model;
}

Box natural_bounds(const std::vector<Parameter>& parameters) {
  const auto n = Index(parameters.size());
  Box box{VectorXd(n), VectorXd(n)};
  for (Index k = 0; k < n; ++k) {
    const Parameter& parameter = parameters[std::size_t(k)];
    box.low[k] = to_natural(parameter.coordinate, parameter.low);
    box.high[k] = to_natural(parameter.coordinate, parameter.high);
  }
  return box;
}

Box room_around(const std::vector<Parameter>& parameters, const Box& bounds,
                const VectorXd& point) {
  Box room{bounds.low - point, bounds.high - point};
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (parameters[k].coordinate == Coordinate::kLinear) continue;
    const auto i = Index(k);
    room.low[i] = std::max(room.low[i], -kLongest);
    room.high[i] = std::min(room.high[i], kLongest);
  }
  return room;
}

VectorXd damped_step(const QuadraticModel& model, double damping, const Box& room) {
  const Index n = model.gradient.size();
  VectorXd root(n);
  for (Index k = 0; k < n; ++k) {
    root[k] = model.scaling[k] > 0.0 ? 1.0 / std::sqrt(model.scaling[k]) : 0.0;
  }
  MatrixXd a = root.asDiagonal() * model.hessian * root.asDiagonal();
  a.diagonal().array() += damping;
  a.diagonal() += root.cwiseAbs2().cwiseProduct(model.spring);
  Box scaled{VectorXd::Zero(n), VectorXd::Zero(n)};
  for (Index k = 0; k < n; ++k) {
    if (root[k] == 0.0) {
      a(k, k) = 1.0;
      continue;
    }
    scaled.low[k] = room.low[k] / root[k];
    scaled.high[k] = room.high[k] / root[k];
  }
  return root.cwiseProduct(bounded_step(a, root.cwiseProduct(model.gradient), scaled));
}

double relative_size(const std::vector<Parameter>& parameters, const VectorXd& step) {
  double size = 0.0;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    size = std::max(size, std::abs(step[Index(k)]) / parameters[k].scale);
  }
  return size;
}

}  // namespace matterfit::fit
