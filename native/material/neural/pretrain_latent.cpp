// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/pretrain_latent.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.hpp"
#include "material/classical/law_constants.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/isotropic_principal.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::material {
namespace {

constexpr std::size_t kStressSamples = 48;  ///< of a material
constexpr std::size_t kStressBatch = 16;    ///< of them, in a step
constexpr std::size_t kFlowSamples = 8;
/// Stresses below this share of the stiffest modulus count as this.
constexpr double kSmallLatentStress = 0.003;
/// Strains of the flow below this count as this, and from 10 on as never met.
constexpr double kSmallStrain = 1e-4;
constexpr double kNever = 10.0;
/// A rate from here on is at once.
constexpr double kAtOnce = 3e6;
/// What a logarithm of the flow counts, against the stress's relative error.
constexpr double kYieldPart = 0.4;
constexpr double kTearPart = 0.1;
constexpr double kRatePart = 0.08;
constexpr double kLearningRate = 3e-3;

struct FlowState {
  double theta;   ///< ln J
  double strain;  ///< equivalent plastic
  double over;    ///< strain beyond yield
};

/// The isotropic law's flow at sampled states.
double yield_at(const IsotropicConstants<double>& c, const FlowState& at, double* slope = nullptr) {
  const double argument = c.yield + c.hardening * at.strain - c.friction * at.theta;
  const double root = std::hypot(argument, kYieldWidth);
  if (slope != nullptr) *slope = 0.5 * (1.0 + argument / root);
  // Without cancellation where the argument is negative.
  if (argument < 0.0) return 0.5 * kYieldWidth * kYieldWidth / (root - argument);
  return 0.5 * (argument + root);
}

/// What the net is to learn of a material.
struct Lesson {
  Eigen::VectorXd features;
  std::vector<PrincipalSample> stresses;
  double modulus = 0.0;  ///< stiffest, over the shear modulus
  std::array<FlowState, kFlowSamples> states{};
  std::array<double, kFlowSamples> yields{};
  std::array<double, kFlowSamples> rates{};
  double tear = 0.0;
  bool flows = false;
};

Lesson lesson_of(const Material& material, Random& random) {
  Lesson out;
  out.features = latent_features(material);
  out.stresses = elastic_samples(material, kStressSamples, random);
  const RestModuli moduli = rest_moduli(material);
  out.modulus = std::max(material.p_wave_modulus(), moduli.bulk + moduli.shear * 4.0 / 3.0);
  IsotropicWeights flow{};
  set_classical_flow(material, moduli.shear, flow);
  const auto c = isotropic_constants<double>(flow);
  const auto classical = law_constants<double>(material);
  out.tear = c.tension;
  out.flows = c.yield < 1.0;
  for (std::size_t k = 0; k < kFlowSamples; ++k) {
    FlowState& at = out.states[k];
    at.theta = random.between(-0.2, 0.05);
    at.strain = k % 2 == 0 ? 0.0 : random.between(0.0, 0.5);
    at.over = random.log_between(1e-4, 0.5);
    out.yields[k] = yield_at(c, at);
    out.rates[k] = c.rate;
    if (material.law == Law::kHerschelBulkley && material.exponent != 1.0) {
      // |s| − √(2/3) τ_Y = η |γ̇|ⁿ, of which the strain beyond yield is lost at ρ = |γ̇|/over.
      out.rates[k] =
          std::pow(2.0 * moduli.shear * at.over / classical.eta, 1.0 / material.exponent) / at.over;
    }
  }
  return out;
}

/// One residual of a logarithm, which counts as met beyond `never`; adds to the sum of squares and
/// gives its slope by the value.
double of_logarithm(double value, double small, double target, double never, double part,
                    double& loss) {
  if (target >= never && value >= never) return 0.0;
  const double wanted = std::min(target, 3.0 * never);
  const double residual = std::log(value + small) - std::log(wanted + small);
  loss += part * residual * residual;
  return 2.0 * part * residual / (value + small);
}

/// The isotropic law of raw outputs, with a shear modulus of 1.
Material decoded(const LatentOutput& x) {
  Material m;
  m.law = Law::kNeuralIsotropic;
  set_decoded(m, x, {});
  m.youngs_modulus = 2.0 * (1.0 + m.poisson_ratio);
  return m;
}

/// The loss of a lesson at raw outputs, and its slope by them; `from` says which stresses.
double lose(const Lesson& lesson, const LatentOutput& x, std::size_t from, LatentOutput& x_bar) {
  const Material m = decoded(x);
  const IsotropicConstants<double> c = isotropic_constants(m);
  IsotropicConstants<double> bar{};
  double loss = 0.0;
  constexpr double kShare = 1.0 / kStressBatch;
  for (std::size_t k = 0; k < kStressBatch; ++k) {
    const PrincipalSample& sample = lesson.stresses[(from + k) % lesson.stresses.size()];
    const double scale = 1.0 / (sample.tau.norm() + kSmallLatentStress * lesson.modulus);
    const Vec3d residual = scale * (principal_stress(c, sample.trial) - sample.tau);
    loss += kShare * residual.squaredNorm();
    add_principal_stress_adjoint(c, sample.trial, 2.0 * kShare * scale * residual, bar);
  }
  constexpr double kEach = 1.0 / kFlowSamples;
  for (std::size_t k = 0; k < kFlowSamples; ++k) {
    const FlowState& at = lesson.states[k];
    double slope = 0.0;
    const double yield = yield_at(c, at, &slope);
    const double argument_bar = slope * of_logarithm(yield, kSmallStrain, lesson.yields[k], kNever,
                                                     kYieldPart * kEach, loss);
    bar.yield += argument_bar;
    bar.hardening += argument_bar * at.strain;
    bar.friction -= argument_bar * at.theta;
    if (!lesson.flows) continue;
    const double rate_bar = of_logarithm(c.rate + c.thinning * at.over, 1e-3, lesson.rates[k],
                                         kAtOnce, kRatePart * kEach, loss);
    bar.rate += rate_bar;
    bar.thinning += rate_bar * at.over;
  }
  bar.tension += of_logarithm(c.tension, kSmallStrain, lesson.tear, kNever, kTearPart, loss);
  MaterialGradient gradient;
  const ModuliGradient moduli = add_isotropic_gradient(m, bar, gradient);
  for (std::size_t i = 1; i < kIsotropicElastic; ++i) {
    x_bar[static_cast<Eigen::Index>(i - 1)] = gradient.weight_moves[i];
  }
  const std::array<double, kLatentBounded> by_value{moduli.bulk,
                                                    gradient.yield_strain,
                                                    gradient.internal_friction,
                                                    gradient.strain_hardening,
                                                    gradient.tear_strain,
                                                    gradient.flow_rate,
                                                    gradient.flow_thinning};
  for (std::size_t k = 0; k < kLatentBounded; ++k) {
    const auto at = static_cast<Eigen::Index>(kLatentWeights + k);
    const BoundedOutput output = bounded_output(k, x[at]);
    x_bar[at] = by_value[k] * output.value * output.slope;
  }
  return loss;
}

/// What is learned, and as the moments of Adam.
struct Learned {
  std::vector<Eigen::MatrixXd> parts;
  explicit Learned(const LatentDecoder& d)
      : parts{d.first, d.first_offset, d.second,  d.second_offset, d.third,
              d.skip,  d.output,       d.encoder, d.encoder_offset} {}
  void clear() {
    for (Eigen::MatrixXd& part : parts) part.setZero();
  }
};

void put(const Learned& from, LatentDecoder& into) {
  into.first = from.parts[0];
  into.first_offset = from.parts[1];
  into.second = from.parts[2];
  into.second_offset = from.parts[3];
  into.third = from.parts[4];
  into.skip = from.parts[5];
  into.output = from.parts[6];
  into.encoder = from.parts[7];
  into.encoder_offset = from.parts[8];
}

Eigen::MatrixXd random_matrix(std::size_t rows, std::size_t columns, Random& random) {
  Eigen::MatrixXd out(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
  const double width = std::sqrt(3.0 / static_cast<double>(columns));
  for (Eigen::Index r = 0; r < out.rows(); ++r) {
    for (Eigen::Index c = 0; c < out.cols(); ++c) out(r, c) = random.between(-width, width);
  }
  return out;
}

/// A code is what the encoder sees but for the last; the outputs are jelly's energy and a flow in
/// the middle of its bounds.
LatentDecoder beginning(Random& random) {
  LatentDecoder d;
  d.first = random_matrix(kLatentHidden, kLatentSize, random);
  d.first_offset = 0.3 * random_matrix(kLatentHidden, 1, random);
  d.second = random_matrix(kLatentHidden, kLatentHidden, random);
  d.second_offset = 0.3 * random_matrix(kLatentHidden, 1, random);
  d.third = 0.01 * random_matrix(kLatentOutputs, kLatentHidden, random);
  d.skip = Eigen::MatrixXd::Zero(kLatentOutputs, kLatentSize);
  d.output = Eigen::VectorXd::Zero(kLatentOutputs);
  Pretraining options;
  options.fit_samples = 400;
  const IsotropicWeights jelly = pretrain_isotropic(start_material(StartLaw::kJelly), options);
  for (std::size_t i = 1; i < kIsotropicElastic; ++i) {
    d.output[static_cast<Eigen::Index>(i - 1)] = jelly[i];
  }
  d.encoder = Eigen::MatrixXd::Identity(kLatentSize, kLatentFeatures);
  d.encoder_offset = Eigen::VectorXd::Zero(kLatentSize);
  return d;
}

/// The slope of a lesson's loss by all that is learned, and the loss.
double backward(const LatentDecoder& d, const Lesson& lesson, std::size_t from, Learned& bar) {
  const LatentCode code = d.encoder * lesson.features + d.encoder_offset;
  const auto [one, two, x] = latent_pass(d, code);
  LatentOutput x_bar = LatentOutput::Zero();
  const double loss = lose(lesson, x, from, x_bar);
  const Eigen::VectorXd two_bar =
      ((d.third.transpose() * x_bar).array() * (1.0 - two.array().square())).matrix();
  const Eigen::VectorXd one_bar =
      ((d.second.transpose() * two_bar).array() * (1.0 - one.array().square())).matrix();
  const LatentCode code_bar = d.first.transpose() * one_bar + d.skip.transpose() * x_bar;
  bar.parts[0].noalias() = one_bar * code.transpose();
  bar.parts[1] = one_bar;
  bar.parts[2].noalias() = two_bar * one.transpose();
  bar.parts[3] = two_bar;
  bar.parts[4].noalias() = x_bar * two.transpose();
  bar.parts[5].noalias() = x_bar * code.transpose();
  bar.parts[6] = x_bar;
  bar.parts[7].noalias() = code_bar * lesson.features.transpose();
  bar.parts[8] = code_bar;
  return loss;
}

/// Adam on batches; the mean loss of the first and of the last tenth of the steps.
struct Losses {
  double first = 0.0;
  double last = 0.0;
};
Losses learn(LatentDecoder& decoder, const std::vector<Lesson>& lessons, std::size_t steps,
             Random& random, Arena& arena) {
  Learned values(decoder);
  Learned mean(decoder);
  Learned square(decoder);
  Learned sum(decoder);
  mean.clear();
  square.clear();
  std::vector<Learned> bars(kLatentBatch, Learned(decoder));
  std::vector<double> found(kLatentBatch);
  std::vector<std::size_t> chosen(kLatentBatch);
  std::vector<std::size_t> from(kLatentBatch);
  const std::size_t tenth = std::max<std::size_t>(1, steps / 10);
  Losses losses;
  for (std::size_t step = 0; step < steps; ++step) {
    for (std::size_t b = 0; b < kLatentBatch; ++b) {
      chosen[b] = random.next() % lessons.size();
      from[b] = random.next() % kStressSamples;
    }
    arena.parallel_for(0, kLatentBatch, 4, [&](std::size_t b) {
      found[b] = backward(decoder, lessons[chosen[b]], from[b], bars[b]);
    });
    sum.clear();
    double loss = 0.0;
    for (std::size_t b = 0; b < kLatentBatch; ++b) {
      loss += found[b] / kLatentBatch;
      for (std::size_t p = 0; p < sum.parts.size(); ++p) {
        sum.parts[p] += bars[b].parts[p] / static_cast<double>(kLatentBatch);
      }
    }
    if (step < tenth) losses.first += loss / static_cast<double>(tenth);
    if (step + tenth >= steps) losses.last += loss / static_cast<double>(tenth);
    double norm = 0.0;
    for (const Eigen::MatrixXd& part : sum.parts) norm += part.squaredNorm();
    const double clip = std::min(1.0, 1.0 / std::sqrt(std::max(norm, 1e-300)));
    const double t = static_cast<double>(step + 1);
    const double along = static_cast<double>(step) / static_cast<double>(steps);
    const double rate =
        kLearningRate * std::min(1.0, t / 100.0) * 0.5 * (1.0 + std::cos(std::numbers::pi * along));
    const double unbias = std::sqrt(1.0 - std::pow(0.999, t)) / (1.0 - std::pow(0.9, t));
    for (std::size_t p = 0; p < sum.parts.size(); ++p) {
      const Eigen::ArrayXXd slope = clip * sum.parts[p].array();
      mean.parts[p] = 0.9 * mean.parts[p].array() + 0.1 * slope;
      square.parts[p] = 0.999 * square.parts[p].array() + 0.001 * slope.square();
      values.parts[p].array() -=
          rate * unbias * mean.parts[p].array() / (square.parts[p].array().sqrt() + 1e-9);
    }
    put(values, decoder);
  }
  return losses;
}

/// Turns and scales the space so that these codes have mean 0 and covariance 1.
void whiten(LatentDecoder& d, const Eigen::MatrixXd& codes) {
  const Eigen::VectorXd mean = codes.rowwise().mean();
  const Eigen::MatrixXd centred = codes.colwise() - mean;
  const Eigen::MatrixXd covariance = centred * centred.transpose() / double(codes.cols());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  const Eigen::VectorXd sizes =
      solver.eigenvalues().cwiseMax(1e-6 * solver.eigenvalues().maxCoeff()).cwiseSqrt();
  // The longest axis first.
  const Eigen::MatrixXd forth =
      (solver.eigenvectors() * sizes.asDiagonal()).rowwise().reverse();  // old of new
  const Eigen::MatrixXd back =
      (sizes.cwiseInverse().asDiagonal() * solver.eigenvectors().transpose()).colwise().reverse();
  d.first_offset += d.first * mean;
  d.output += d.skip * mean;
  d.first = d.first * forth;
  d.skip = d.skip * forth;
  d.encoder_offset = back * (d.encoder_offset - mean);
  d.encoder = back * d.encoder;
}

void find_classes(LatentDecoder& d, std::uint64_t seed) {
  constexpr int kOfEach = 400;
  d.classes.resize(kLatentClasses.size(), kLatentSize);
  d.spreads.resize(kLatentClasses.size(), kLatentSize);
  for (std::size_t k = 0; k < kLatentClasses.size(); ++k) {
    Random random(seed + 17 * k);
    Eigen::MatrixXd codes(kLatentSize, kOfEach);
    for (int i = 0; i < kOfEach; ++i) codes.col(i) = latent_code(d, classical_of_class(k, random));
    const Eigen::VectorXd mean = codes.rowwise().mean();
    const Eigen::MatrixXd centred = codes.colwise() - mean;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(centred * centred.transpose() /
                                                                double(kOfEach));
    const Eigen::Index last = kLatentSize - 1;
    Eigen::VectorXd axis = solver.eigenvectors().col(last);
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    if (axis[largest] < 0.0) axis = -axis;
    const auto row = static_cast<Eigen::Index>(k);
    d.classes.row(row) = mean.transpose();
    d.spreads.row(row) = (std::sqrt(solver.eigenvalues()[last]) * axis).transpose();
  }
}

}  // namespace

Material classical_of_class(std::size_t flow_class, Random& random) {
  Material m;
  m.poisson_ratio = 0.5 - random.log_between(0.01, 0.5);
  m.youngs_modulus = 2.0 * (1.0 + m.poisson_ratio);
  const bool more = random.uniform() < 0.5;
  const double strain = random.log_between(1.5e-3, 0.3);
  switch (flow_class) {
    case 0: {
      constexpr std::array<Law, 3> kElastic{Law::kFixedCorotated, Law::kNeoHookean,
                                            Law::kStvkHencky};
      m.law = kElastic[random.next() % kElastic.size()];
      break;
    }
    case 1:
      m.law = Law::kVonMises;
      m.yield_stress = std::sqrt(1.5) * 2.0 * strain;
      if (more) m.hardening = std::sqrt(1.5) * 2.0 * random.log_between(1e-3, 1.0);
      break;
    case 2:
      m.law = Law::kHerschelBulkley;
      m.yield_stress = std::sqrt(1.5) * 2.0 * strain;
      if (more) m.exponent = random.between(0.5, 1.0);
      // An excess of one thousandth of strain is lost at this rate, whatever the exponent.
      {
        const double rate = random.log_between(1.0, 1e6);
        const double over = 1e-3;
        m.viscosity = over / std::pow(rate * over, m.exponent);
      }
      break;
    case 3: {
      m.law = Law::kDruckerPrager;
      m.friction_angle = random.between(10.0, 50.0);
      if (more) {
        const double phi = m.friction_angle * std::numbers::pi / 180.0;
        const double bulk3 = 3.0 * m.lambda() + 2.0;
        m.cohesion = random.log_between(1e-4, 0.03) * bulk3 * std::tan(phi);
      }
      break;
    }
    default: {
      m.law = Law::kNewtonian;
      const double time = random.log_between(1e-8, 2e-4);  // η/K [s]
      m.bulk_modulus = 1.0;
      m.viscosity = time;
      m.bulk_modulus = 1.0 / rest_moduli(m).shear;
      m.viscosity = time * m.bulk_modulus;
      break;
    }
  }
  return m;
}

std::shared_ptr<const LatentDecoder> pretrain_latent(const LatentPretraining& options,
                                                     Arena& arena) {
  Random random(options.seed);
  std::vector<Lesson> lessons;
  lessons.reserve(options.materials);
  for (std::size_t i = 0; i < options.materials; ++i) {
    // Three elastic laws, one of each other class.
    const std::size_t turn = i % 7;
    lessons.push_back(lesson_of(classical_of_class(turn < 3 ? 0 : turn - 2, random), random));
  }
  LatentDecoder decoder = beginning(random);
  const Losses losses = learn(decoder, lessons, options.steps, random, arena);
  if (!(losses.last < losses.first)) {
    throw_compute("pretrain_latent: the regression does not improve on its start.");
  }
  Eigen::MatrixXd codes(kLatentSize, static_cast<Eigen::Index>(lessons.size()));
  for (std::size_t i = 0; i < lessons.size(); ++i) {
    codes.col(static_cast<Eigen::Index>(i)) =
        decoder.encoder * lessons[i].features + decoder.encoder_offset;
  }
  whiten(decoder, codes);
  find_classes(decoder, options.seed);
  // The decoder as a file gives it back.
  return latent_decoder(latent_tensors(decoder), "latent");
}

IsotropicWeights isotropic_weights_of(const Material& latent) {
  IsotropicConstants<double> c = isotropic_constants(latent);
  IsotropicWeights weights{};
  std::size_t i = 0;
  c.for_each([&](double entry) {
    const bool scaled =
        (i > 0 && i < kShapeOwnWeight) || (i >= kVolumeGainWeight && i < kVolumeTraceWeight);
    const bool offset = (i >= kShapeOffsetWeight && i < kVolumeGainWeight) ||
                        (i >= kVolumeOffsetWeight && i < kIsotropicElastic);
    const bool positive = i == 0 || i >= kIsotropicElastic;
    weights[i] = scaled     ? std::log(entry / c.mu)
                 : offset   ? std::atanh(entry)
                 : positive ? std::log(std::max(entry, 1e-6))
                            : entry;
    ++i;
  });
  return weights;
}

std::vector<LatentAccuracy> latent_accuracy(const std::shared_ptr<const LatentDecoder>& decoder,
                                            std::size_t materials, std::uint64_t seed,
                                            Arena& arena) {
  std::vector<LatentAccuracy> out;
  for (std::size_t k = 0; k < kLatentClasses.size(); ++k) {
    std::vector<double> stress;
    std::vector<double> yield;
    std::vector<double> rate;
    std::size_t of_class = 0;
    Random random(seed + 31 * k);
    for (std::size_t i = 0; i < materials; ++i) {
      const Material classical = classical_of_class(k, random);
      const LatentCode code = latent_code(*decoder, classical);
      Material latent;
      set_latent(latent, decoder, std::span<const double>(code.data(), kLatentSize));
      latent.youngs_modulus = 2.0 * (1.0 + latent.poisson_ratio);  // a shear modulus of 1
      stress.push_back(accuracy(isotropic_weights_of(latent), classical, seed + i, arena).stress);
      constexpr std::array<FlowClass, kLatentClasses.size()> kFlowClasses{
          FlowClass::kElastic, FlowClass::kPlastic, FlowClass::kPlastic, FlowClass::kGranular,
          FlowClass::kLiquid};
      if (flow_class(latent) == kFlowClasses[k]) ++of_class;
      const Lesson lesson = lesson_of(classical, random);
      if (!lesson.flows) continue;
      const IsotropicConstants<double> c = isotropic_constants(latent);
      double of_yield = 0.0;
      double of_rate = 0.0;
      for (std::size_t s = 0; s < kFlowSamples; ++s) {
        const FlowState& at = lesson.states[s];
        of_yield +=
            std::pow(std::log((yield_at(c, at) + kSmallStrain) / (lesson.yields[s] + kSmallStrain)),
                     2) /
            kFlowSamples;
        of_rate += std::pow(std::log(std::min(c.rate + c.thinning * at.over, kAtOnce) /
                                     std::min(lesson.rates[s], kAtOnce)),
                            2) /
                   kFlowSamples;
      }
      yield.push_back(std::sqrt(of_yield));
      rate.push_back(std::sqrt(of_rate));
    }
    const auto at = [&](std::vector<double>& of, double share) {
      if (of.empty()) return 0.0;
      std::sort(of.begin(), of.end());
      return of[static_cast<std::size_t>(share * static_cast<double>(of.size() - 1))];
    };
    out.push_back({kLatentClasses[k], at(stress, 0.5), at(stress, 0.95), at(yield, 0.5),
                   at(yield, 0.95), at(rate, 0.5),
                   static_cast<double>(of_class) / static_cast<double>(materials)});
  }
  return out;
}

}  // namespace matterfit::material
