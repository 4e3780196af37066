// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/theta_prior.hpp"

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

}  // namespace matterfit::diagnose
