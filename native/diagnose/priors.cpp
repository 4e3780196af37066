// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/priors.hpp"

namespace matterfit::diagnose {

using Eigen::Index;
using Eigen::VectorXd;

ThetaPrior theta_prior(const Model& model, double corrections) {
  const auto& parameters = model.parameters();
  ThetaPrior prior{VectorXd::Zero(Index(parameters.size())),
                   VectorXd::Zero(Index(parameters.size()))};
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    if (!parameters[p].prior) continue;
    const double sigma = parameters[p].prior->sigma / parameters[p].scale;
    prior.precision[Index(p)] = 1.0 / (sigma * sigma);
    prior.mean[Index(p)] = parameters[p].prior->mean;
  }
  for (const Index p : model.corrections()) prior.precision[p] /= corrections * corrections;
  return prior;
}

double precision_of(const Number& number) {
  if (!(number.deviation > 0.0)) return 0.0;
  const double sigma = number.deviation / number.scale;
  return 1.0 / (sigma * sigma);
}

CausePriors cause_priors(const Model& model, const State& state) {
  Index count = 0;
  for (const Active& cause : state.causes) count += cause.values.size();
  CausePriors priors{VectorXd::Zero(count), VectorXd::Zero(count)};
  Index at = 0;
  for (const Active& cause : state.causes) {
    const std::vector<Number>& numbers = model.effects()[std::size_t(cause.effect)].numbers;
    for (Index k = 0; k < cause.values.size(); ++k, ++at) {
      const Number& number = numbers[std::size_t(k)];
      priors.precision[at] = precision_of(number);
      priors.beyond[at] = (cause.values[k] - number.neutral) / number.scale;
    }
  }
  return priors;
}

}  // namespace matterfit::diagnose
