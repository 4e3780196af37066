// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/far_starts.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <map>
#include <utility>

#include "diagnose/starts.hpp"
#include "diagnose/state_box.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What is left of a residual once parameters have adapted to first order.
class Adapted {
 public:
  Adapted(const Refitter& refitter, const State& base, const MatrixXd& slopes)
      : refitter_(refitter),
        prior_(theta_prior(refitter.study().model(), refitter.corrections())),
        bounds_(box_of(refitter.study().model(), base)),
        scales_(scales_of(refitter.study().model(), base)),
        used_(refitter.study().used().size()),
        white_(refitter.whitening().apply(slopes.topRows(used_))) {
    hessian_ = white_.transpose() * white_;
    hessian_.diagonal() += prior_.precision;
    hessian_ = regularised(std::move(hessian_));
  }

  struct Left {
    double half = 0.0;  ///< half of χ² and priors
    VectorXd theta;     ///< the parameters, adapted
  };

  /// What is left of `prediction`, which was simulated at `theta`.
  [[nodiscard]] Left left(const VectorXd& prediction, const VectorXd& theta) const {
    VectorXd missed = (refitter_.study().measured() - prediction).head(used_);
    if (refitter_.bias().size() > 0) missed -= kBiasMean * refitter_.bias().head(used_);
    const VectorXd residual = refitter_.whitening().apply(missed);
    const VectorXd off = (theta - prior_.mean).cwiseQuotient(scales_);
    const VectorXd pull = prior_.precision.cwiseProduct(off);
    const VectorXd gradient = pull - white_.transpose() * residual;
    const VectorXd step =
        fit::bounded_step(hessian_, gradient, room_about(theta, bounds_, scales_));
    const double here = 0.5 * (residual.squaredNorm() + off.dot(pull));
    return {here + gradient.dot(step) + 0.5 * step.dot(hessian_ * step),
            theta + scales_.cwiseProduct(step)};
  }

 private:
  const Refitter& refitter_;
  ThetaPrior prior_;
  fit::Box bounds_;
  VectorXd scales_;
  Index used_;
  MatrixXd white_;
  MatrixXd hessian_;
};

/// One shape of an effect, and what is left beside it at the sizes that were looked at.
struct Shape {
  Candidate candidate;
  std::map<double, Adapted::Left> left;  ///< by size, of those that could be simulated
  [[nodiscard]] std::map<double, Adapted::Left>::const_iterator best() const {
    return std::ranges::min_element(left, {}, [](const auto& size) { return size.second.half; });
  }
};

/// The best size again, and halfway to those on either side of it; sizes are apart by factors.
std::vector<double> about_best(const Shape& shape) {
  const auto best = shape.best();
  std::vector<double> sizes = {best->first};
  const auto halfway = [&](double other) {
    const bool factors = best->first * other > 0.0;
    sizes.push_back(factors ? std::copysign(std::sqrt(best->first * other), other)
                            : 0.5 * (best->first + other));
  };
  if (best != shape.left.begin()) halfway(std::prev(best)->first);
  if (std::next(best) != shape.left.end()) halfway(std::next(best)->first);
  return sizes;
}

class Looking {
 public:
  Looking(const Refitter& refitter, const State& base, const MatrixXd& slopes,
          const std::vector<int>& known)
      : study_(refitter.study()), base_(base), adapted_(refitter, base, slopes) {
    for (const Candidate& candidate : candidates_of(study_.model(), base)) {
      if (effect_of(candidate).far_tries.empty()) continue;
      if (std::ranges::count(known, candidate.effect) == 0) shapes_.push_back({candidate, {}});
    }
  }

  std::vector<Attempt> run() {
    look([&](const Shape& shape) {
      const std::vector<double>& sizes = effect_of(shape.candidate).far_tries;
      return std::vector{sizes[sizes.size() / 2]};
    });
    leave_the_worst();
    look([&](const Shape& shape) { return effect_of(shape.candidate).far_tries; });
    for (int round = 0; round < kRounds; ++round) {
      look([&](const Shape& shape) {
        return may_be_best(shape) ? about_best(shape) : std::vector<double>();
      });
    }
    std::vector<Attempt> attempts;
    for (const Shape& shape : shapes_) {
      if (shape.left.empty() || best_of(shape.candidate.effect) != &shape) continue;
      Attempt attempt;
      attempt.causes = {shape.candidate};
      // Slopes at the base are of another motion: the refit makes its own.
      attempt.start.states = {with(shape, shape.best()->first)};
      attempts.push_back(std::move(attempt));
    }
    return attempts;
  }

 private:
  /// Twice halves what lies between the sizes that are named.
  static constexpr int kRounds = 2;
  /// Shapes that leave more than so many times what the best one does are out, but for a share of
  /// an effect's shapes: one size says little of another.
  static constexpr double kOut = 4.0;
  static constexpr double kShare = 1.0 / 3.0;

  [[nodiscard]] const Effect& effect_of(const Candidate& candidate) const {
    return study_.model().effects()[std::size_t(candidate.effect)];
  }

  [[nodiscard]] State with(const Shape& shape, double size) const {
    const Effect& effect = effect_of(shape.candidate);
    VectorXd there = VectorXd::Zero(Index(effect.numbers.size()));
    there[0] = (size - effect.numbers[0].neutral) / effect.numbers[0].scale;
    State state = extended(study_.model(), base_, shape.candidate, there, 1.0);
    if (!shape.left.empty()) state.theta = shape.best()->second.theta;
    return state;
  }

  /// The effect's first shape that leaves least; null where none could be simulated.
  [[nodiscard]] const Shape* best_of(int effect) const {
    const Shape* best = nullptr;
    for (const Shape& shape : shapes_) {
      if (shape.candidate.effect != effect || shape.left.empty()) continue;
      if (best == nullptr || shape.best()->second.half < best->best()->second.half) best = &shape;
    }
    return best;
  }

  [[nodiscard]] bool may_be_best(const Shape& shape) const {
    if (shape.left.empty()) return false;
    return shape.best()->second.half < kOut * best_of(shape.candidate.effect)->best()->second.half;
  }

  /// Leaves out shapes that hardly come into question by the size at which all were looked at.
  void leave_the_worst() {
    std::vector<Shape> kept;
    for (const Shape& shape : shapes_) {
      if (shape.left.empty()) continue;
      const auto better = [&](const Shape& other) {
        return other.candidate.effect == shape.candidate.effect && !other.left.empty() &&
               other.best()->second.half < shape.best()->second.half;
      };
      const auto same = [&](const Shape& other) {
        return other.candidate.effect == shape.candidate.effect;
      };
      const auto rank = double(std::ranges::count_if(shapes_, better));
      const auto all = double(std::ranges::count_if(shapes_, same));
      if (rank < std::max(1.0, kShare * all) || may_be_best(shape)) kept.push_back(shape);
    }
    shapes_ = std::move(kept);
  }

  void look(const std::function<std::vector<double>(const Shape&)>& sizes) {
    std::vector<State> states;
    std::vector<std::pair<std::size_t, double>> of;
    for (std::size_t i = 0; i < shapes_.size(); ++i) {
      for (const double size : sizes(shapes_[i])) {
        states.push_back(with(shapes_[i], size));
        of.emplace_back(i, size);
      }
    }
    if (states.empty()) return;
    const auto seen = study_.predict(states, Study::Wanted::kUsed);
    for (std::size_t k = 0; k < of.size(); ++k) {
      if (!seen[k]) continue;
      const auto [i, size] = of[k];
      Shape& shape = shapes_[i];
      // Where it was simulated before it was by another promise of how parameters adapt.
      shape.left[size] = adapted_.left(*seen[k], states[k].theta);
    }
  }

  const Study& study_;
  const State& base_;
  Adapted adapted_;
  std::vector<Shape> shapes_;
};

}  // namespace

std::vector<Attempt> far_starts(const Refitter& refitter, const State& base, const MatrixXd& slopes,
                                const std::vector<int>& known) {
  return Looking(refitter, base, slopes, known).run();
}

}  // namespace matterfit::diagnose
