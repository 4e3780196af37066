// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/likeness.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <string_view>
#include <utility>

#include "base/error.hpp"
#include "base/random.hpp"
#include "material/classical/law_constants.hpp"
#include "material/classical/point_law.hpp"
#include "material/neural/isotropic_material.hpp"

namespace matterfit::material {
namespace {

constexpr std::size_t kWays = 24;
constexpr int kForth = 12;  ///< states on a way out
constexpr int kBack = 4;    ///< and on the way back
/// A state is reached in so many steps: a flow that is solved implicitly is smooth then.
constexpr int kSteps = 8;
/// Stresses below this share of their root mean square count as this.
constexpr double kSmall = 0.01;
/// The law flows in a state where the last step loses more of its strain.
constexpr double kFlows = 0.05;
/// A law is as near as the nearest within this share of its distance, and this distance.
constexpr double kAsNear = 0.01;
constexpr double kAsNearStress = 1e-4;
constexpr int kIterations = 40;
constexpr int kRounds = 6;
/// Relative differences below it count by their square.
constexpr double kSmooth = 1e-3;
constexpr double kDifference = 1e-4;

/// A prescribed motion without rotation: the steps' stretches along the axes.
struct Way {
  double dt = 0.0;            ///< of a step [s]
  std::vector<Vec3d> states;  ///< total Hencky strains, each kSteps steps after the one before
};

Vec3d shape_direction(Random& random) {
  for (;;) {
    Vec3d v(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0));
    v.array() -= v.mean();
    const double square = v.squaredNorm();
    if (square > 1e-2 && square < 1.0) return v / std::sqrt(square);
  }
}

std::vector<Way> ways(const Excitation& over, std::uint64_t seed) {
  Random random(seed);
  std::vector<Way> all;
  for (std::size_t k = 0; k < kWays; ++k) {
    const Vec3d along = shape_direction(random);
    const double volume = random.between(-over.compression, over.expansion);
    const double rate = over.slowest * std::pow(over.fastest / over.slowest, random.uniform());
    Way way;
    way.dt = over.strain / (kForth * kSteps * rate);
    for (int i = 1; i <= kForth + kBack; ++i) {
      const double shape = i <= kForth ? i : 2 * kForth - i;
      const double grown = std::min(1.0, 2.0 * i / kForth);  // the volume by half way
      way.states.push_back(along * (over.strain * shape / kForth) +
                           Vec3d::Constant(grown * volume / 3.0));
    }
    all.push_back(std::move(way));
  }
  return all;
}

/// Principal stresses of all states of all ways, one after the other.
struct Stresses {
  std::vector<Vec3d> tau;
  std::vector<std::uint8_t> flows;
};

Stresses follow(const Material& material, const std::vector<Way>& ways) {
  Stresses out;
  for (const Way& way : ways) {
    const PointLaw law(material, way.dt);
    PointState state;
    Vec3d at = Vec3d::Zero();
    for (const Vec3d& next : way.states) {
      const Vec3d step = (next - at) / kSteps;
      const Mat3d stretch = Vec3d(step.array().exp()).asDiagonal();
      Vec3d tau = Vec3d::Zero();
      double before = 0.0;
      for (int i = 0; i < kSteps; ++i) {
        before = state.strain;
        tau = law.advance(stretch, state).diagonal();
      }
      const double moved = std::sqrt(2.0 / 3.0) * Vec3d(step.array() - step.mean()).norm();
      out.flows.push_back(state.strain - before > kFlows * moved ? 1 : 0);
      out.tau.push_back(tau);
      at = next;
    }
  }
  return out;
}

/// A parameter of a classical law that is looked for; in its logarithm, or as it is.
struct Sought {
  double Material::*member;
  double low;
  double high;
  bool linear = false;
};

std::vector<Sought> sought_of(Law law) {
  constexpr double kLeast = 1e-3;
  constexpr double kMost = 1e12;
  std::vector<Sought> list;
  if (traits(law).fluid) {
    list.push_back({&Material::bulk_modulus, kLeast, kMost});
  } else {
    list.push_back({&Material::youngs_modulus, kLeast, kMost});
    list.push_back({&Material::poisson_ratio, -0.85, 0.4995, true});
  }
  if (traits(law).uses("yield_stress")) list.push_back({&Material::yield_stress, kLeast, kMost});
  if (traits(law).uses("hardening")) list.push_back({&Material::hardening, kLeast, kMost});
  if (traits(law).uses("viscosity")) list.push_back({&Material::viscosity, 1e-9, 1e8});
  if (traits(law).uses("friction_angle")) {
    list.push_back({&Material::friction_angle, 0.5, 75.0, true});
    list.push_back({&Material::cohesion, kLeast, 1e11});
  }
  return list;
}

double natural(const Sought& one, double value) {
  const double within = std::clamp(value, one.low, one.high);
  return one.linear ? within : std::log(within);
}
double physical(const Sought& one, double value) {
  return std::clamp(one.linear ? value : std::exp(value), one.low, one.high);
}

/// A classical law with the moduli and the flow of the neural one, as material/neural/pretrain.hpp
/// has them the other way about. `dev` is the stress [Pa] that the neural law flows with.
Material classical_start(const Material& neural, Law law, double dev) {
  Material m = neural;
  m.law = law;
  m.start.reset();
  m.hardening = 0.0;
  m.exponent = 1.0;
  const double shear = neural.youngs_modulus / (2.0 * (1.0 + neural.poisson_ratio));
  m.bulk_modulus = neural.lambda() + 2.0 / 3.0 * shear;
  m.yield_stress = std::sqrt(1.5) * dev;
  m.viscosity = shear / neural.flow_rate;
  m.hardening = std::sqrt(1.5) * 2.0 * shear * neural.strain_hardening;
  const double alpha =
      neural.internal_friction * (1.0 - 2.0 * neural.poisson_ratio) / (1.0 + neural.poisson_ratio);
  const double part = alpha / std::sqrt(2.0 / 3.0);
  const double sine = std::clamp(3.0 * part / (2.0 + part), 0.0, 0.95);
  m.friction_angle = std::asin(sine) * 180.0 / std::numbers::pi;
  const double tip = 2.0 * shear * neural.yield_strain;  // |dev τ| without pressure
  m.cohesion = tip * (3.0 - sine) / (std::sqrt(2.0 / 3.0) * 6.0 * std::sqrt(1.0 - sine * sine));
  return m;
}

/// The neural law along the ways, and what differences are divided by.
class Comparison {
 public:
  Comparison(const Material& neural, const Excitation& over, std::uint64_t seed)
      : ways_(ways(over, seed)), neural_(follow(neural, ways_)) {
    double sum = 0.0;
    double dev = 0.0;
    double count = 0.0;
    for (std::size_t k = 0; k < neural_.tau.size(); ++k) {
      sum += neural_.tau[k].squaredNorm() / double(neural_.tau.size());
      if (neural_.flows[k] == 0) continue;
      dev += deviator(neural_.tau[k]).norm();
      count += 1.0;
    }
    small_ = kSmall * std::sqrt(sum);
    flowing_ = count / double(neural_.tau.size());
    yields_at_ = count > 0.0 ? dev / count : 0.0;
  }

  [[nodiscard]] double flowing() const { return flowing_; }
  /// |dev τ| at which it flows in the mean, 0: it does nowhere [Pa].
  [[nodiscard]] double yields_at() const { return yields_at_; }

  /// (τ − τ*)/scale of all states.
  [[nodiscard]] Eigen::VectorXd residual(const Material& material) const {
    const Stresses other = follow(material, ways_);
    Eigen::VectorXd all(Eigen::Index(3 * other.tau.size()));
    for (std::size_t k = 0; k < other.tau.size(); ++k) {
      all.segment<3>(Eigen::Index(3 * k)) =
          (other.tau[k] - neural_.tau[k]) / (neural_.tau[k].norm() + small_);
    }
    return all;
  }

  void measure(Likeness& like) const {
    const Stresses other = follow(like.material, ways_);
    double flow = 0.0;
    double count = 0.0;
    for (std::size_t k = 0; k < other.tau.size(); ++k) {
      const Vec3d gap = other.tau[k] - neural_.tau[k];
      like.stress += gap.norm() / (neural_.tau[k].norm() + small_) / double(other.tau.size());
      if (neural_.flows[k] == 0) continue;
      flow += deviator(gap).norm() / (deviator(neural_.tau[k]).norm() + small_);
      count += 1.0;
    }
    like.flow = count > 0.0 ? flow / count : 0.0;
    like.flowing = flowing_;
  }

 private:
  static Vec3d deviator(const Vec3d& tau) { return tau.array() - tau.mean(); }

  std::vector<Way> ways_;
  Stresses neural_;
  double small_ = 0.0;
  double flowing_ = 0.0;
  double yields_at_ = 0.0;
};

/// The material of least Σ (w |τ − τ*|)² by Levenberg–Marquardt with differences, `weights` w one a
/// state.
Material nearest(const Comparison& comparison, const Material& material,
                 const std::vector<Sought>& list, const Eigen::VectorXd& weights) {
  const auto count = static_cast<Eigen::Index>(list.size());
  Eigen::VectorXd point(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Sought& one = list[static_cast<std::size_t>(i)];
    point[i] = natural(one, material.*one.member);
  }
  const auto at = [&](const Eigen::VectorXd& where) {
    Material m = material;
    for (Eigen::Index i = 0; i < count; ++i) {
      const Sought& one = list[static_cast<std::size_t>(i)];
      m.*one.member = physical(one, where[i]);
    }
    return m;
  };
  const auto residual_at = [&](const Eigen::VectorXd& where) {
    Eigen::VectorXd all = comparison.residual(at(where));
    for (Eigen::Index k = 0; k < weights.size(); ++k) all.segment<3>(3 * k) *= weights[k];
    return all;
  };
  Eigen::VectorXd residual = residual_at(point);
  double damping = 1e-3;
  for (int step = 0; step < kIterations && damping < 1e8; ++step) {
    Eigen::MatrixXd jacobian(residual.size(), count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Sought& one = list[static_cast<std::size_t>(i)];
      const double reach = one.linear ? kDifference * (one.high - one.low) : kDifference;
      const double end = one.linear ? one.high : std::log(one.high);
      const double by = point[i] + reach > end ? -reach : reach;
      Eigen::VectorXd moved = point;
      moved[i] += by;
      jacobian.col(i) = (residual_at(moved) - residual) / by;
    }
    Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
    const double before = residual.squaredNorm();
    bool settled = false;
    while (damping < 1e8) {
      Eigen::MatrixXd damped = normal;
      damped.diagonal() += (damping * (normal.diagonal().array() + 1e-9)).matrix();
      const Eigen::VectorXd move = damped.ldlt().solve(jacobian.transpose() * residual);
      Eigen::VectorXd trial = point;
      for (Eigen::Index i = 0; i < count; ++i) {
        const Sought& one = list[static_cast<std::size_t>(i)];
        const double most = one.linear ? 0.2 * (one.high - one.low) : 2.0;
        trial[i] = natural(one, physical(one, point[i] - std::clamp(move[i], -most, most)));
      }
      const Eigen::VectorXd there = residual_at(trial);
      if (!there.allFinite() || there.squaredNorm() >= before) {
        damping *= 4.0;
        continue;
      }
      settled = there.squaredNorm() > before * (1.0 - 1e-8);
      point = trial;
      residual = there;
      damping = std::max(0.2 * damping, 1e-9);
      break;
    }
    if (settled) break;
  }
  return at(point);
}

/// The material of least Σ |τ − τ*|, by weights made anew (Lawson): what a few states have of
/// their own, as where a flow is turned around, does not bend the numbers.
Material nearest(const Comparison& comparison, Material material, const std::vector<Sought>& list) {
  Eigen::VectorXd weights;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::VectorXd residual = comparison.residual(material);
    if (round == 0) weights = Eigen::VectorXd::Ones(residual.size() / 3);
    if (round > 0) {
      for (Eigen::Index k = 0; k < weights.size(); ++k) {
        weights[k] = 1.0 / std::sqrt(residual.segment<3>(3 * k).norm() + kSmooth);
      }
    }
    material = nearest(comparison, material, list, weights);
  }
  return material;
}

constexpr std::array kClassical = {Law::kFixedCorotated, Law::kNeoHookean,      Law::kStvkHencky,
                                   Law::kVonMises,       Law::kHerschelBulkley, Law::kDruckerPrager,
                                   Law::kNewtonian};

/// A hardening that over the strains changes the yield stress by little is none.
bool hardens(const Material& m) {
  constexpr double kTold = 1e-2;
  return m.traits().uses("hardening") && m.hardening > kTold * m.yield_stress;
}

std::size_t numbers_of(const Likeness& like) {
  const bool idle = like.material.traits().uses("hardening") && !hardens(like.material);
  return sought_of(like.material.law).size() - (idle ? 1 : 0);
}

}  // namespace

std::vector<Likeness> likenesses(const Material& neural, const Excitation& over,
                                 std::uint64_t seed) {
  if (!is_isotropic(neural.law)) {
    throw_input("the material is of the law " + std::string(traits(neural.law).name) +
                ". What a material is like can be said of neural_isotropic and latent alone.");
  }
  const bool sound = over.strain > 0.0 && over.strain < 3.0 && over.compression >= 0.0 &&
                     over.compression < 2.0 && over.expansion >= 0.0 && over.expansion < 2.0 &&
                     over.slowest > 0.0 && over.fastest >= over.slowest &&
                     over.fastest < std::numeric_limits<double>::infinity();
  if (!sound) {
    throw_input(
        "the strains and rates that laws are to be compared over are not within (0, 3), volume "
        "strains within [0, 2), rates above 0 1/s and in order.");
  }
  const Comparison comparison(neural, over, seed);
  std::vector<Likeness> all;
  for (const Law law : kClassical) {
    // Where it flows nowhere the laws that yield would be the elastic one under them.
    if (comparison.flowing() == 0.0 && !traits(law).elastic()) continue;
    Likeness like;
    like.material =
        nearest(comparison, classical_start(neural, law, comparison.yields_at()), sought_of(law));
    comparison.measure(like);
    if (std::isfinite(like.stress)) all.push_back(std::move(like));
  }
  if (all.empty()) throw_compute("no classical law could be compared with the neural one.");
  std::stable_sort(all.begin(), all.end(),
                   [](const Likeness& a, const Likeness& b) { return a.stress < b.stress; });
  const double as_near = all.front().stress * (1.0 + kAsNear) + kAsNearStress;
  const auto end = std::find_if(all.begin(), all.end(),
                                [&](const Likeness& like) { return like.stress > as_near; });
  std::stable_sort(all.begin(), end, [](const Likeness& a, const Likeness& b) {
    return numbers_of(a) < numbers_of(b);
  });
  return all;
}

std::string likeness_sentence(const Likeness& like, const Excitation& over) {
  const Material& m = like.material;
  std::string formula;
  switch (m.law) {
    case Law::kFixedCorotated:
      formula = "τ = 2μ(F − R)Fᵀ + λ J(J − 1) I";
      break;
    case Law::kNeoHookean:
      formula = law_constants<double>(m).split ? "τ = μ J^(−2/3) dev(FFᵀ) + κ J(J − 1) I"
                                               : "τ = μ(FFᵀ − I) + λ ln J I";
      break;
    case Law::kStvkHencky:
      formula = "τ = 2μ ε + λ tr ε I";
      break;
    case Law::kVonMises:
      formula = "τ = 2μ ε + λ tr ε I, |dev τ| ≤ √(2/3) τ_Y";
      break;
    case Law::kHerschelBulkley:
      formula = "τ = 2μ ε + λ tr ε I, |dev τ| ≤ √(2/3) τ_Y + 2η |dev D|";
      break;
    case Law::kDruckerPrager:
      formula = "τ = 2μ ε + λ tr ε I, |dev τ| ≤ −√(2/3) 2 sin φ/(3 − sin φ) (tr τ − 3c cot φ)";
      break;
    case Law::kNewtonian:
      formula = "τ = (K/7)(J − J⁻⁶) I + 2η J D";
      break;
    case Law::kNeuralIsotropic:
    case Law::kLatent:
    case Law::kPublished:
      break;
  }
  std::string numbers;
  const auto add = [&](std::string_view name, double value, std::string_view unit) {
    numbers += fmt::format("{}{} = {:.4g}{}{}", numbers.empty() ? "" : ", ", name, value,
                           unit.empty() ? "" : " ", unit);
  };
  if (m.traits().fluid) {
    add("K", m.bulk_modulus, "Pa");
  } else {
    add("E", m.youngs_modulus, "Pa");
    add("ν", m.poisson_ratio, "");
  }
  if (m.traits().uses("yield_stress")) add("τ_Y", m.yield_stress, "Pa");
  if (hardens(m)) add("hardening", m.hardening, "Pa");
  if (m.traits().uses("friction_angle")) {
    add("φ", m.friction_angle, "degrees");
    add("c", m.cohesion, "Pa");
  }
  if (m.traits().uses("viscosity")) add("η", m.viscosity, "Pa s");
  std::string sentence = fmt::format(
      "Most like {}: {} with {}. Its stress differs by {:.2g} % in the mean up to strains of "
      "{:.2g}",
      m.traits().label, formula, numbers, 100.0 * like.stress, over.strain);
  if (like.flowing > 0.0) {
    sentence += fmt::format(", by {:.2g} % of the deviator where it flows at {:.2g} to {:.2g} 1/s",
                            100.0 * like.flow, over.slowest, over.fastest);
  }
  return sentence + ".";
}

}  // namespace matterfit::material
