// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/machine_tests.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.hpp"
#include "material/neural/isotropic_principal.hpp"

namespace matterfit::material {
namespace {

/// The share of the mean stress below which errors count as they are, not by the stress.
constexpr double kSmallTestStress = 0.5;
constexpr double kSmallGuardStress = 0.05;
constexpr double kGuardWeight = 0.3;
constexpr double kGuardReach = 1.5;  // of the tests' largest ln λ: twice ¾, two axes are pulled
constexpr int kGuardStates = 20;
constexpr int kStartStates = 80;
constexpr int kTestSteps = 400;
/// Holds weights that no state tells of.
constexpr double kTestPrior = 1e-3;
constexpr double kStartPrior = 1e-2;

/// A state that keeps its volume, and how its nominal stress follows from the principal ones:
/// P = (τ₁ − τ₃) `factor`.
struct TestState {
  Vec3d strain;
  double factor;
};

TestState state_of(Pull pull, double by) {
  switch (pull) {
    case Pull::kUniaxial: {
      const double log = std::log(by);
      return {{log, -0.5 * log, -0.5 * log}, 1.0 / by};
    }
    case Pull::kEquibiaxial: {
      const double log = std::log(by);
      return {{log, log, -2.0 * log}, 1.0 / by};
    }
    case Pull::kShear:
      break;
  }
  // Principal stretches e^±s, sinh s = γ/2; τ_xy = ½ (τ₁ − τ₃) sin 2φ, tan 2φ = 2/γ.
  const double log = std::asinh(0.5 * by);
  return {{log, 0.0, -log}, 0.5 / std::cosh(log)};
}

/// What a neo-Hookean of μ = 1 has there.
double neo_hookean(const TestState& state) {
  return state.factor * (std::exp(2.0 * state.strain[0]) - std::exp(2.0 * state.strain[2]));
}

/// A wanted stress with the weight of its error.
struct Wanted {
  TestState state;
  double nominal;
  double weight;
};

/// What the regression moves: μ and the shape units but for their share of the trace.
std::vector<std::size_t> moved_weights() {
  std::vector<std::size_t> list = {0};
  for (const std::size_t first : {kShapeGainWeight, kShapeOwnWeight, kShapeOffsetWeight}) {
    for (std::size_t k = 0; k < kShapeUnits; ++k) list.push_back(first + k);
  }
  return list;
}

struct Linear {
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
};

Linear linearise(const IsotropicWeights& weights, const IsotropicWeights& start,
                 const std::vector<Wanted>& wanted, const std::vector<std::size_t>& moved,
                 double prior) {
  const auto columns = static_cast<Eigen::Index>(moved.size());
  const auto rows = static_cast<Eigen::Index>(wanted.size());
  Linear out{Eigen::VectorXd::Zero(rows + columns), Eigen::MatrixXd::Zero(rows + columns, columns)};
  for (Eigen::Index row = 0; row < rows; ++row) {
    const Wanted& one = wanted[static_cast<std::size_t>(row)];
    const PrincipalResponse at = principal_response(weights, one.state.strain);
    const double scale = one.weight * one.state.factor;
    out.residual[row] = scale * (at.tau[0] - at.tau[2]) - one.weight * one.nominal;
    for (Eigen::Index k = 0; k < columns; ++k) {
      const auto weight = static_cast<Eigen::Index>(moved[static_cast<std::size_t>(k)]);
      out.jacobian(row, k) = scale * (at.by_weights(0, weight) - at.by_weights(2, weight));
    }
  }
  for (Eigen::Index k = 0; k < columns; ++k) {
    const std::size_t weight = moved[static_cast<std::size_t>(k)];
    out.residual[rows + k] = prior * (weights[weight] - start[weight]);
    out.jacobian(rows + k, k) = prior;
  }
  return out;
}

IsotropicWeights regress(const IsotropicWeights& start, const std::vector<Wanted>& wanted,
                         double prior) {
  const std::vector<std::size_t> moved = moved_weights();
  IsotropicWeights weights = start;
  Linear at = linearise(weights, start, wanted, moved, prior);
  const double first = at.residual.squaredNorm();
  double damping = 1e-2;
  for (int step = 0; step < kTestSteps && damping < 1e10; ++step) {
    const Eigen::MatrixXd normal = at.jacobian.transpose() * at.jacobian;
    Eigen::MatrixXd damped = normal;
    damped.diagonal() += damping * (normal.diagonal().array() + 1e-9).matrix();
    const Eigen::VectorXd move = damped.ldlt().solve(at.jacobian.transpose() * at.residual);
    IsotropicWeights trial = weights;
    for (std::size_t k = 0; k < moved.size(); ++k) {
      trial[moved[k]] -= std::clamp(move[static_cast<Eigen::Index>(k)], -1.0, 1.0);
    }
    Linear there = linearise(trial, start, wanted, moved, prior);
    const double before = at.residual.squaredNorm();
    if (!there.residual.allFinite() || there.residual.squaredNorm() >= before) {
      damping *= 4.0;
      continue;
    }
    const bool settled = there.residual.squaredNorm() > before * (1.0 - 1e-10);
    weights = trial;
    at = std::move(there);
    damping = std::max(0.3 * damping, 1e-12);
    if (settled) break;
  }
  if (!(at.residual.squaredNorm() < first)) {
    throw_compute("the regression to tests of a testing machine does not improve on its start.");
  }
  return weights;
}

void check(std::span<const MachineTest> tests) {
  if (tests.empty()) throw_input("there is no test to regress a law to.");
  for (const MachineTest& test : tests) {
    const std::string name(pull_name(test.pull));
    if (test.by.size() != test.nominal.size() || test.by.empty()) {
      throw_input("the " + name + " test has not as many stretches as stresses, or none.");
    }
    for (std::size_t k = 0; k < test.by.size(); ++k) {
      const bool sound = std::isfinite(test.by[k]) && std::isfinite(test.nominal[k]) &&
                         (test.pull == Pull::kShear || test.by[k] > 0.0);
      if (!sound) throw_input("the " + name + " test has a stretch or a stress that is none.");
    }
  }
}

double mean_stress(std::span<const MachineTest> tests) {
  double sum = 0.0;
  double count = 0.0;
  for (const MachineTest& test : tests) {
    for (const double stress : test.nominal) sum += std::abs(stress);
    count += double(test.nominal.size());
  }
  if (!(sum > 0.0)) throw_input("all stresses of the tests are 0.");
  return sum / count;
}

std::vector<Wanted> measured(std::span<const MachineTest> tests) {
  const double small = kSmallTestStress * mean_stress(tests);
  std::vector<Wanted> all;
  for (const MachineTest& test : tests) {
    for (std::size_t k = 0; k < test.by.size(); ++k) {
      all.push_back({state_of(test.pull, test.by[k]), test.nominal[k],
                     1.0 / (std::abs(test.nominal[k]) + small)});
    }
  }
  return all;
}

/// A unit that stiffens where it is pulled, at strains by the largest one: where a regression to a
/// neo-Hookean begins.
IsotropicWeights stiffening(double shear, double largest) {
  constexpr std::array kOwn = {1.2, 1.6, 2.0, 2.0};
  constexpr std::array kOffset = {0.0, -0.8, -1.6, -2.2};
  constexpr std::array kGain = {0.0, 1.0, 2.0, 3.0};
  IsotropicWeights w = plain_isotropic(0.1 * shear, shear);
  for (std::size_t k = 0; k < kShapeUnits; ++k) {
    const double own = kOwn[k] / largest;
    w[kShapeGainWeight + k] = kGain[k] + 2.0 * std::log(largest);
    w[kShapeOwnWeight + k] = own;
    w[kShapeTraceWeight + k] = 0.0;
    w[kShapeOffsetWeight + k] = kOffset[k];
  }
  return w;
}

/// Along a pull of one axis, by its logarithm; below 0 it is pressed.
TestState along_axis(double log) { return state_of(Pull::kUniaxial, std::exp(log)); }

}  // namespace

double neo_hookean_of_tests(std::span<const MachineTest> tests) {
  check(tests);
  double above = 0.0;
  double below = 0.0;
  for (const Wanted& one : measured(tests)) {
    const double unit = one.weight * neo_hookean(one.state);
    above += unit * one.weight * one.nominal;
    below += unit * unit;
  }
  if (!(above > 0.0)) throw_input("the stresses of the tests do not grow with their stretches.");
  return above / below;
}

IsotropicWeights regress_machine_tests(std::span<const MachineTest> tests, double poisson_ratio) {
  check(tests);
  if (!(poisson_ratio > 0.0 && poisson_ratio < 0.5)) {
    throw_input("the Poisson ratio of a rubber lies between 0 and .5.");
  }
  const double shear = neo_hookean_of_tests(tests);
  double pulled = 0.0;   // largest logarithm of a stretch, as far as one axis is pulled
  double pressed = 0.0;  // the same where it is pressed
  for (const MachineTest& test : tests) {
    for (const double by : test.by) {
      const Vec3d strain = state_of(test.pull, by).strain;
      const double most = strain.maxCoeff();
      const double least = strain.minCoeff();
      if (test.pull == Pull::kShear || most >= -least) pulled = std::max(pulled, most);
      if (test.pull == Pull::kShear || -least > most) pressed = std::max(pressed, -least);
    }
  }
  const double largest = std::max(pulled, pressed);

  std::vector<Wanted> of_start;
  for (int k = 0; k <= kStartStates; ++k) {
    const double log = largest * (-kGuardReach + (kGuardReach + 1.05) * k / kStartStates);
    const TestState state = along_axis(log);
    const double nominal = shear * neo_hookean(state);
    of_start.push_back({state, nominal, 1.0 / (std::abs(nominal) + kSmallGuardStress * shear)});
  }
  const IsotropicWeights start = regress(stiffening(shear, largest), of_start, kStartPrior);

  std::vector<Wanted> wanted = measured(tests);
  const double small = kSmallGuardStress * mean_stress(tests);
  for (int k = 1; k <= kGuardStates; ++k) {
    const double log = kGuardReach * largest * k / kGuardStates;
    for (const double side : {-log, log}) {
      if (side < 0.0 ? log <= pressed : log <= pulled || log > largest) continue;
      // Pressed along one axis is pulled along the two others.
      const TestState state =
          side < 0.0 ? state_of(Pull::kEquibiaxial, std::exp(0.5 * log)) : along_axis(side);
      const double nominal = shear * neo_hookean(state);
      wanted.push_back({state, nominal, kGuardWeight / (std::abs(nominal) + small)});
    }
  }
  IsotropicWeights weights = regress(start, wanted, kTestPrior);
  const auto rest = rest_stiffness(isotropic_constants<double>(weights));
  const double bulk =
      rest.shear * 2.0 * (1.0 + poisson_ratio) / (3.0 * (1.0 - 2.0 * poisson_ratio));
  const double kappa = std::max(bulk - rest.bulk_by_shape, 1e-3 * rest.shear);
  weights[1] = std::log(kappa) - weights[0];
  return weights;
}

double r_squared(std::span<const double> found, std::span<const double> measured) {
  double mean = 0.0;
  for (const double value : measured) mean += value / double(measured.size());
  double missed = 0.0;
  double spread = 0.0;
  for (std::size_t k = 0; k < measured.size(); ++k) {
    missed += (found[k] - measured[k]) * (found[k] - measured[k]);
    spread += (measured[k] - mean) * (measured[k] - mean);
  }
  return 1.0 - missed / spread;
}

}  // namespace matterfit::material
