// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/tests_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/cancel_check.hpp"
#include "base/error.hpp"
#include "effects/effect_type.hpp"
#include "effects/term.hpp"
#include "material/neural/machine_tests.hpp"
#include "material/stress_curves.hpp"

namespace matterfit::job {
namespace {

using diagnose::Number;

constexpr std::size_t kFewestStretches = 6;
/// Share of each test's readings, the farthest, that is held out where no test is.
constexpr double kKeptBack = 0.3;
/// At which an elastic law is followed [1/s]; it does not feel it.
constexpr double kPullRate = 1.0;
/// How far Young's modulus may be from its start, as a factor.
constexpr double kMostModulus = 30.0;
/// In the modulus: a size at which one would care for what is added to it.
constexpr double kCare = 0.2;
/// What may be added to it at most.
constexpr double kMostAddedModulus = 20.0;
constexpr std::size_t kExperimentStretches = 12;
/// Ī₁ − 3 that a test is taken to reach at least.
constexpr double kLeastInvariant = 1e-6;

double size_of_pull(material::Pull pull, double by) {
  return pull == material::Pull::kShear ? by : by - 1.0;
}

/// Weights by which readings are shares of a stress: 1 over the measured one and half their mean.
std::vector<double> weights_of(const std::vector<double>& nominal) {
  double mean = 0.0;
  for (const double stress : nominal) mean += std::abs(stress) / double(nominal.size());
  std::vector<double> weights;
  for (const double stress : nominal) weights.push_back(1.0 / (std::abs(stress) + 0.5 * mean));
  return weights;
}

/// Ī₁ − 3 of a pull that keeps the volume.
double first_invariant(material::Pull pull, double by) {
  if (pull == material::Pull::kShear) return by * by;
  const double square = by * by;
  return pull == material::Pull::kUniaxial ? square + 2.0 / by - 3.0
                                           : 2.0 * square + 1.0 / (square * square) - 3.0;
}

Number reading(const char* name, const char* unit, double scale, double most) {
  Number number;
  number.name = name;
  number.unit = unit;
  number.scale = scale;
  number.low = -most;
  number.high = most;
  return number;
}

void set_value(effects::Effect& effect, const char* key, std::size_t component, double value) {
  effect.values[effect.type->offset(*effect.type->find(key)) + component] = value;
}

}  // namespace

struct TestsModel::Test {
  material::Pull pull;
  std::vector<double> by;
  std::vector<double> weight;
  std::size_t reader;  ///< index of its machine's readings in Specimen
};

TestsModel::~TestsModel() = default;

TestsModel::TestsModel(const TestsDoc& doc, int threads, const Interrupter& interrupter)
    : interrupter_(interrupter), arena_(threads), noise_(doc.noise) {
  const double shear = material::neo_hookean_of_tests(doc.fitted);
  material_.law = doc.law;
  material_.poisson_ratio = doc.poisson_ratio;
  material_.youngs_modulus = 2.0 * shear * (1.0 + doc.poisson_ratio);
  fit::Parameter modulus;
  modulus.name = "material.E";
  modulus.unit = "Pa";
  modulus.coordinate = fit::Coordinate::kLog;
  modulus.start = material_.youngs_modulus;
  modulus.low = modulus.start / kMostModulus;
  modulus.high = modulus.start * kMostModulus;
  modulus.scale = kCare;
  modulus.words = "the stiffness";
  modulus.record = "a test of the material";
  parameters_ = {modulus};
  for (const material::MachineTest& test : doc.fitted) add_test(test, false);
  for (const material::MachineTest& test : doc.held_out) add_test(test, true);
  if (doc.held_out.empty()) hold_back_ends();
  add_experiments();
  add_causes();
  add_readings();
}

void TestsModel::add_test(const material::MachineTest& test, bool held_out) {
  std::string name(material::pull_name(test.pull));
  const auto alike = std::ranges::count(tests_, test.pull, &Test::pull);
  if (alike > 0) name += fmt::format(" {}", alike + 1);
  const std::size_t count = test.by.size();
  diagnose::Capture capture;
  capture.name = name;
  capture.rest = {Vec3d::Zero()};
  capture.axes = {true, false, false};
  capture.noise = noise_;
  capture.positions = Eigen::VectorXd::Zero(Eigen::Index(3 * count));
  const std::vector<double> weights = weights_of(test.nominal);
  std::size_t readings = 0;
  for (std::size_t k = 0; k < count; ++k) {
    capture.times.push_back(double(k));
    capture.positions[Eigen::Index(3 * k)] = weights[k] * test.nominal[k];
    // A machine that is set to 0 without load says nothing there.
    const bool zero = size_of_pull(test.pull, test.by[k]) == 0.0 && test.nominal[k] == 0.0;
    readings += zero ? 0 : 1;
    capture.use.push_back(zero       ? diagnose::Use::kIgnored
                          : held_out ? diagnose::Use::kHeldOut
                                     : diagnose::Use::kUsed);
  }
  if (readings < kFewestStretches) {
    throw_input(
        fmt::format("tests: the {} test has {} readings under load; a diagnosis needs {} at least.",
                    name, readings, kFewestStretches));
  }
  captures_.push_back(std::move(capture));
  tests_.push_back({test.pull, test.by, weights, tests_.size()});
}

void TestsModel::hold_back_ends() {
  for (const Test& test : tests_) {
    std::vector<diagnose::Use>& use = captures_[test.reader].use;
    std::vector<std::size_t> order;
    for (std::size_t k = 0; k < use.size(); ++k) {
      if (use[k] == diagnose::Use::kUsed) order.push_back(k);
    }
    const auto strain = [&](std::size_t k) {
      return std::abs(material::pull_strain(test.pull, test.by[k]));
    };
    std::ranges::stable_sort(order, {}, strain);
    const auto kept = static_cast<std::size_t>((1.0 - kKeptBack) * double(order.size()));
    for (std::size_t i = kept; i < order.size(); ++i) use[order[i]] = diagnose::Use::kHeldOut;
  }
}

void TestsModel::add_experiments() {
  double strain = 0.0;
  double stress = 0.0;
  for (const Test& test : tests_) {
    for (const double by : test.by) {
      strain = std::max(strain, std::abs(material::pull_strain(test.pull, by)));
    }
    stress = std::max(stress, 1.0 / std::ranges::min(test.weight));
  }
  for (const material::Pull pull : material::kPulls) {
    if (std::ranges::count(tests_, pull, &Test::pull) > 0) continue;
    Test test{pull, {}, {}, tests_.size()};
    for (std::size_t k = 0; k < kExperimentStretches; ++k) {
      const double at = strain * double(k + 1) / double(kExperimentStretches);
      test.by.push_back(material::pull_at(pull, at));
      test.weight.push_back(1.0 / stress);
    }
    further_.push_back(std::move(test));
  }
}

std::vector<diagnose::Experiment> TestsModel::experiments() const {
  std::vector<diagnose::Experiment> all;
  for (const Test& test : further_) {
    diagnose::Experiment& one = all.emplace_back();
    one.name = std::string(material::pull_name(test.pull)) + " test";
    one.sentence = fmt::format("Test it in {} too.",
                               test.pull == material::Pull::kUniaxial      ? "one direction"
                               : test.pull == material::Pull::kEquibiaxial ? "two directions"
                                                                           : "shear");
    one.layout.name = one.name;
    one.layout.rest = {Vec3d::Zero()};
    one.layout.axes = {true, false, false};
    for (std::size_t k = 0; k < test.by.size(); ++k) one.layout.times.push_back(double(k));
    one.layout.use.assign(test.by.size(), diagnose::Use::kUsed);
  }
  return all;
}

diagnose::Effect& TestsModel::add(std::string name, const char* group, std::string sentence,
                                  Apply apply) {
  diagnose::Effect& effect = effects_.emplace_back();
  effect.name = std::move(name);
  effect.scope = "shared";
  effect.group = group;
  effect.sentence = std::move(sentence);
  apply_.push_back(std::move(apply));
  return effect;
}

void TestsModel::add_causes() {
  const double shear = material_.mu();
  double most = kLeastInvariant;
  for (const Test& test : tests_) {
    for (const double by : test.by) most = std::max(most, first_invariant(test.pull, by));
  }
  // Yeoh's two terms beside the neo-Hookean one, in what they add where it is stretched most.
  constexpr std::array kPowers{1.0, 2.0};
  diagnose::Effect& stiffer =
      add("strain_stiffening", "material",
          "The material stiffens as it is stretched; where it is stretched most: {value}.",
          [most, kPowers](std::span<const double> v, int, Specimen& specimen) {
            for (std::size_t k = 0; k < kPowers.size(); ++k) {
              effects::Effect effect = effects::make_effect("strain_stiffening");
              set_value(effect, "modulus", 0, v[k] / std::pow(most, kPowers[k]));
              set_value(effect, "exponent", 0, kPowers[k]);
              specimen.effects.push_back(std::move(effect));
            }
          });
  stiffer.numbers = {reading("linear", "Pa", kCare * shear, kMostAddedModulus * shear),
                     reading("quadratic", "Pa", kCare * shear, kMostAddedModulus * shear)};
  stiffer.confused_with = {"fibres", "poisson_ratio", "second_invariant"};

  diagnose::Effect& second =
      add("second_invariant", "material",
          "The material softens as it is pulled along one axis (Mooney's term): {value}.",
          [](std::span<const double> v, int, Specimen& specimen) {
            effects::Effect effect = effects::make_effect("second_invariant");
            set_value(effect, "modulus", 0, v[0]);
            specimen.effects.push_back(std::move(effect));
          });
  second.numbers = {reading("modulus", "Pa", kCare * shear, kMostAddedModulus * shear)};
  second.numbers[0].low = -kCare * shear;
  second.confused_with = {"strain_stiffening"};

  diagnose::Effect& grain =
      add("fibres", "material", "The material is {value} stiffer {variant}, as fibres make it.",
          [](std::span<const double> v, int variant, Specimen& specimen) {
            effects::Effect effect = effects::make_effect("fibres");
            for (std::size_t c = 0; c < 3; ++c) {
              set_value(effect, "direction", c, c == std::size_t(2 * variant) ? 1.0 : 0.0);
            }
            set_value(effect, "modulus", 0, v[0]);
            specimen.effects.push_back(std::move(effect));
          });
  grain.variants = {"along the pull", "across it"};
  grain.numbers = {reading("modulus", "Pa", kCare * shear, kMostAddedModulus * shear)};
  grain.numbers[0].low = 0.0;
  grain.numbers[0].one_sided = true;
  grain.confused_with = {"strain_stiffening"};

  const double nu = material_.poisson_ratio;
  diagnose::Effect& squeezed =
      add("poisson_ratio", "material",
          "The material gives way in volume: a Poisson ratio lower by {value}.",
          [](std::span<const double> v, int, Specimen& specimen) {
            specimen.material.poisson_ratio -= v[0];
          });
  Number lower = reading("lower", "", 0.02, 0.9 * nu);
  lower.low = 0.0;
  lower.one_sided = true;
  squeezed.numbers = {lower};
  squeezed.tries = {0.1 * nu, 0.3 * nu};
  squeezed.confused_with = {"strain_stiffening"};
}

void TestsModel::add_readings() {
  diagnose::Effect& length =
      add("gauge_length", "measurement",
          "Elongations are larger than what was read by a share of {value}.",
          [](std::span<const double> v, int, Specimen& specimen) { specimen.gauge = 1.0 + v[0]; });
  length.numbers = {reading("share", "", 0.02, 0.3)};
  length.confused_with = {"strain_stiffening"};
  for (const Test& test : tests_) {
    const std::size_t t = test.reader;
    if (std::ranges::count(captures_[t].use, diagnose::Use::kUsed) == 0) continue;
    const double half = 0.5 / std::ranges::min(test.weight);  // of the largest stress, about
    diagnose::Effect& zero = add(
        "load_zero", "measurement", "The load cell reads {value} where there is no force.",
        [t](std::span<const double> v, int, Specimen& specimen) { specimen.load_zero[t] = v[0]; });
    zero.scope = "capture " + captures_[t].name;
    zero.numbers = {reading("stress", "Pa", 0.1 * half, 3.0 * half)};
    diagnose::Effect& cell = add("load_cell", "measurement",
                                 "The load cell reads forces too large by a share of {value}.",
                                 [t](std::span<const double> v, int, Specimen& specimen) {
                                   specimen.load_factor[t] = 1.0 + v[0];
                                 });
    cell.scope = "capture " + captures_[t].name;
    cell.numbers = {reading("share", "", 0.02, 0.5)};
  }
}

Specimen TestsModel::specimen(const diagnose::Point& point) const {
  Specimen made;
  made.material = material_;
  made.material.youngs_modulus = fit::value_within_bounds(parameters_[0], point.theta[0]);
  // One more, which reads as it should, for tests that could be made.
  made.load_factor.assign(tests_.size() + 1, 1.0);
  made.load_zero.assign(tests_.size() + 1, 0.0);
  for (const diagnose::Point::Cause& cause : point.causes) {
    apply_[std::size_t(cause.effect)]({cause.values.data(), std::size_t(cause.values.size())},
                                      cause.variant, made);
  }
  return made;
}

std::optional<diagnose::Motion> TestsModel::pull(const Specimen& specimen,
                                                 const std::vector<Test>& tests) const {
  std::vector<std::unique_ptr<effects::Term>> terms;
  for (const effects::Effect& effect : specimen.effects) {
    if (!effects::is_neutral(effect)) terms.push_back(effect.type->make(effect, {}));
  }
  material::FurtherStress further;
  if (!terms.empty()) {
    further = [&terms](const Mat3d& elastic) {
      effects::MaterialPoint point;
      point.deformation_gradient = elastic;
      Mat3d stress = Mat3d::Zero();
      for (const auto& term : terms) stress += term->stress(point, {});
      return stress;
    };
  }
  std::vector<double> read;
  for (const Test& test : tests) {
    check_cancel(&interrupter_);
    std::vector<double> stops;
    for (const double by : test.by) {
      const double rest = by - size_of_pull(test.pull, by);
      stops.push_back(rest + specimen.gauge * size_of_pull(test.pull, by));
    }
    try {
      const auto curve =
          material::stress_curve(specimen.material, test.pull, stops, kPullRate, further);
      for (std::size_t k = 0; k < curve.size(); ++k) {
        const double stress =
            specimen.load_factor[test.reader] * curve[k].nominal + specimen.load_zero[test.reader];
        read.insert(read.end(), {test.weight[k] * stress, 0.0, 0.0});
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kCompute) throw;
      return std::nullopt;  // as a simulation that cannot be completed
    }
  }
  diagnose::Motion motion;
  motion.positions = Eigen::Map<const Eigen::VectorXd>(read.data(), Eigen::Index(read.size()));
  return motion;
}

std::vector<std::optional<diagnose::Motion>> TestsModel::pull_all(
    const std::vector<diagnose::Point>& points, const std::vector<Test>& tests) const {
  check_cancel(&interrupter_);
  std::vector<std::optional<diagnose::Motion>> motions(points.size());
  arena_.parallel_for(0, points.size(), 1,
                      [&](std::size_t i) { motions[i] = pull(specimen(points[i]), tests); });
  return motions;
}

std::vector<std::optional<diagnose::Motion>> TestsModel::simulate(
    const std::vector<diagnose::Point>& points) const {
  return pull_all(points, tests_);
}

std::vector<std::optional<diagnose::Motion>> TestsModel::simulate_experiment(
    int experiment, const std::vector<diagnose::Point>& points) const {
  return pull_all(points, {further_[std::size_t(experiment)]});
}

}  // namespace matterfit::job
