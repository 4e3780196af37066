// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/members.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <iterator>
#include <numeric>
#include <utility>

#include "diagnose/priors.hpp"
#include "diagnose/refit.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kUsualNoise = 5e-4;  // [m]
constexpr int kRoundsOfTimes = 2;     // a third gained nothing (docs/dev/impacts.md)
constexpr double kWorthARun = 0.9;    // of the misfit before
/// Shares of the used time that all parameters are adapted over, one after another: a phase that is
/// off by more than a radian at the end is off by less at the beginning.
constexpr std::array<double, 3> kGrowing = {0.3, 0.6, 1.0};
constexpr int kRoundsOfAll = 11;
constexpr int kMostFailures = 2;
constexpr double kFirstDampingOfMember = 0.3;
/// Standard deviation of what a number adapts by, in scales: what the used rows hardly tell is not
/// to move far.
constexpr double kLeashOfMember = 2.0;
/// The ratio of the members' variance to that of the stated noise below which nothing depends on
/// it.
constexpr double kMatters = 1.0;

/// Gauss–Newton of some numbers of the members, with the slopes of the state.
class Members {
 public:
  using Runs = std::vector<std::optional<VectorXd>>;

  Members(const Study& study, const State& state, const MatrixXd& theta,
          const std::vector<Numerics>& variants, std::vector<Index> numbers, bool leashed,
          Runs& runs)
      : study_(study),
        state_(state),
        theta_(theta(Eigen::all, numbers)),
        variants_(variants),
        numbers_(std::move(numbers)),
        runs_(runs),
        weights_(stated_noise(study.model(), study.used()).cwiseInverse()),
        slopes_(weights_.asDiagonal() * theta_.topRows(study.used().size())),
        precision_(theta_prior(study.model()).precision(numbers_)) {
    if (leashed) precision_ = precision_.cwiseMax(1.0 / (kLeashOfMember * kLeashOfMember));
    MatrixXd normal = slopes_.transpose() * slopes_;
    normal.diagonal() += precision_;
    factors_.compute(regularised(std::move(normal)));
    for (const Index number : numbers_) {
      scales_.push_back(study.model().parameters()[std::size_t(number)].scale);
    }
  }

  [[nodiscard]] std::vector<std::size_t> that_ran(std::size_t first, std::size_t end) const {
    std::vector<std::size_t> members;
    for (std::size_t m = first; m < std::min(end, runs_.size()); ++m) {
      if (runs_[m]) members.push_back(m);
    }
    return members;
  }

  /// What slopes promise, believed.
  void step_without_runs(const std::vector<std::size_t>& members) const {
    for (const std::size_t m : members) {
      *runs_[m] += theta_ * factors_.solve(slopes_.transpose() * apart(*runs_[m]));
    }
  }

  /// What slopes promise to leave of a run's squares over the stated noise.
  [[nodiscard]] double promised(std::size_t member) const {
    const VectorXd left = apart(*runs_[member]);
    const VectorXd gradient = slopes_.transpose() * left;
    return left.squaredNorm() - gradient.dot(factors_.solve(gradient));
  }

  void search(const std::vector<std::size_t>& members, int rounds) {
    std::vector<Member> going;
    going.reserve(members.size());
    for (const std::size_t m : members) going.push_back({m, VectorXd::Zero(Index(scales_.size()))});
    for (int round = 0; round < rounds && !going.empty(); ++round) going = stepped(going);
  }

  /// The same from the beginning of the used rows on, damped where a step leads nowhere.
  void search_growing(const std::vector<std::size_t>& members) {
    std::vector<Window> windows;
    windows.reserve(kGrowing.size());
    for (const double share : kGrowing) windows.push_back(window_of(share));
    std::vector<Growing> going;
    for (const std::size_t m : members) {
      Growing& one = going.emplace_back();
      one.variant = m;
      one.offset = VectorXd::Zero(Index(scales_.size()));
      one.run = runs_[m];
    }
    for (int round = 0; round < kRoundsOfAll && !going.empty(); ++round) {
      std::vector<VectorXd> offsets;
      std::vector<State> states;
      std::vector<Numerics> numerics;
      std::vector<std::vector<double>> until;
      for (const Growing& one : going) {
        const Window& window = windows[one.window];
        offsets.push_back(one.offset);
        if (one.run) offsets.back() += window.step(apart(*one.run), one, precision_);
        states.push_back(moved(offsets.back()));
        numerics.push_back(variants_[one.variant]);
        until.push_back(window.until);
      }
      auto again = study_.predict_variants(states, numerics, until);
      std::vector<Growing> on;
      for (std::size_t k = 0; k < going.size(); ++k) {
        Growing& one = going[k];
        if (!advance(windows[one.window], std::move(offsets[k]), std::move(again[k]), one))
          continue;
        if (one.window < windows.size()) {
          on.push_back(std::move(one));
        } else {
          keep_if_nearer(one);
        }
      }
      going = std::move(on);
    }
    for (Growing& one : going) {
      if (one.run && one.window + 1 == windows.size()) keep_if_nearer(one);
    }
  }

 private:
  struct Member {
    std::size_t variant;
    VectorXd offset;  ///< of the numbers, in scales
  };
  struct Growing {
    std::size_t variant = 0;
    VectorXd offset;
    std::optional<VectorXd> run;  ///< at the offset; nothing: not over this window yet
    std::size_t window = 0;
    double damping = 0.0;
    int failures = 0;
  };
  /// The rows of a capture up to a share of the time that is used of it.
  struct Window {
    VectorXd within;            ///< 1 or 0, a row
    std::vector<double> until;  ///< Point::until; empty: all
    double rows = 0.0;
    MatrixXd slopes;
    MatrixXd normal;

    [[nodiscard]] VectorXd step(const VectorXd& apart, const Growing& one,
                                const VectorXd& precision) const {
      MatrixXd damped = normal;
      damped.diagonal() *= 1.0 + one.damping;
      const Eigen::LDLT<MatrixXd> factors(regularised(std::move(damped)));
      return factors.solve(slopes.transpose() * apart - precision.cwiseProduct(one.offset));
    }
    [[nodiscard]] double misfit(const VectorXd& apart, const VectorXd& offset,
                                const VectorXd& precision) const {
      return within.cwiseProduct(apart).squaredNorm() + offset.dot(precision.cwiseProduct(offset));
    }
  };

  [[nodiscard]] Window window_of(double share) const {
    const Rows& used = study_.used();
    Window window;
    window.within = VectorXd::Zero(used.size());
    if (share < 1.0) {
      for (const Capture& capture : study_.model().captures()) {
        window.until.push_back(capture.times.front() - 1.0);
      }
    }
    for (const Series& series : used.series()) {
      const double first = used.time(series.begin);
      const double end = first + share * (used.time(series.end - 1) - first);
      if (share < 1.0) {
        double& until = window.until[std::size_t(series.capture)];
        until = std::max(until, end);
      }
      for (Index i = series.begin; i < series.end; ++i) {
        window.within[i] = used.time(i) <= end ? 1.0 : 0.0;
      }
    }
    window.rows = window.within.sum();
    window.slopes = window.within.asDiagonal() * slopes_;
    window.normal = window.slopes.transpose() * window.slopes;
    window.normal.diagonal() += precision_;
    return window;
  }

  /// Takes a run in. False: it cannot be simulated over this window, and goes no further.
  [[nodiscard]] bool advance(const Window& window, VectorXd offset, std::optional<VectorXd> seen,
                             Growing& one) const {
    if (!one.run) {
      one.run = std::move(seen);
      return one.run.has_value();
    }
    const double was = window.misfit(apart(*one.run), one.offset, precision_);
    const double is = seen ? window.misfit(apart(*seen), offset, precision_) : was;
    const bool gained = is < was;
    if (gained) {
      one.run = std::move(seen);
      one.offset = std::move(offset);
      one.damping *= 0.1;
      one.failures = 0;
    } else {
      one.damping = std::max(10.0 * one.damping, kFirstDampingOfMember);
      ++one.failures;
    }
    const bool settled =
        gained ? !(is < kWorthARun * was) || is < window.rows : one.failures >= kMostFailures;
    if (!settled) return true;
    ++one.window;
    one.failures = 0;
    one.damping = 0.0;
    // What is beyond this window was not looked at.
    if (!window.until.empty()) one.run.reset();
    return true;
  }

  void keep_if_nearer(Growing& one) {
    std::optional<VectorXd>& before = runs_[one.variant];
    if (apart(*one.run).squaredNorm() < apart(*before).squaredNorm()) before = std::move(one.run);
  }

  [[nodiscard]] State moved(const VectorXd& offset) const {
    State there = state_;
    for (std::size_t k = 0; k < numbers_.size(); ++k) {
      there.theta[numbers_[k]] += scales_[k] * offset[Index(k)];
    }
    return there;
  }

  [[nodiscard]] VectorXd apart(const VectorXd& run) const {
    return weights_.asDiagonal() * (*runs_[0] - run).head(study_.used().size());
  }

  /// Those that gain enough to go on.
  [[nodiscard]] std::vector<Member> stepped(const std::vector<Member>& going) {
    std::vector<State> states;
    std::vector<Numerics> numerics;
    std::vector<VectorXd> offsets;
    for (const Member& member : going) {
      const VectorXd step = factors_.solve(slopes_.transpose() * apart(*runs_[member.variant]) -
                                           precision_.cwiseProduct(member.offset));
      offsets.emplace_back(member.offset + step);
      states.push_back(moved(offsets.back()));
      numerics.push_back(variants_[member.variant]);
    }
    auto again = study_.predict_variants(states, numerics);
    std::vector<Member> gaining;
    for (std::size_t k = 0; k < going.size(); ++k) {
      std::optional<VectorXd>& before = runs_[going[k].variant];
      if (!again[k]) continue;
      const auto misfit = [&](const VectorXd& run, const VectorXd& offset) {
        return apart(run).squaredNorm() + offset.dot(precision_.cwiseProduct(offset));
      };
      const double was = misfit(*before, going[k].offset);
      const double is = misfit(*again[k], offsets[k]);
      if (!(is < was)) continue;
      before = std::move(again[k]);
      if (is < kWorthARun * was) gaining.push_back({going[k].variant, offsets[k]});
    }
    return gaining;
  }

  const Study& study_;
  const State& state_;
  MatrixXd theta_;
  const std::vector<Numerics>& variants_;
  std::vector<Index> numbers_;
  Runs& runs_;
  VectorXd weights_;
  MatrixXd slopes_;
  VectorXd precision_;
  Eigen::LDLT<MatrixXd> factors_;
  std::vector<double> scales_;
};

}  // namespace

VectorXd stated_noise(const Model& model, const Rows& rows) {
  VectorXd noise(rows.size());
  for (const Series& series : rows.series()) {
    const double stated = model.captures()[std::size_t(series.capture)].noise;
    noise.segment(series.begin, series.end - series.begin)
        .setConstant(stated > 0.0 ? stated : kUsualNoise);
  }
  return noise;
}

namespace {

std::vector<Index> all_of(const MatrixXd& theta) {
  std::vector<Index> numbers(std::size_t(theta.cols()));
  std::iota(numbers.begin(), numbers.end(), Index(0));
  return numbers;
}

/// A member of which slopes leave less than this share of what they leave of the worst is small
/// beside that.
constexpr double kSmallBeside = 0.002;

/// Impacts follow the recording, so that one's error is not multiplied at the next and slopes tell
/// most members' part. The half that they leave farther off is simulated where slopes bring it:
/// what they leave there is mostly their own error.
void search_farther_half(Members& members, std::size_t runs) {
  std::vector<std::size_t> ran = members.that_ran(1, runs);
  std::vector<double> left(runs, 0.0);
  for (const std::size_t m : ran) left[m] = members.promised(m);
  std::ranges::stable_sort(ran, std::greater<>(), [&](std::size_t m) { return left[m]; });
  ran.resize(ran.size() / 2);
  members.search(ran, kRoundsOfTimes);
}

/// Searches the members of which slopes leave something, each by its own: how far slopes hold is
/// not alike.
void adapt_all(const Study& study, Members& members, std::size_t runs) {
  std::vector<double> left(runs, 0.0);
  const std::vector<std::size_t> ran = members.that_ran(1, runs);
  for (const std::size_t m : ran) left[m] = members.promised(m);
  const double small = std::max(kMatters * double(study.used().size()),
                                kSmallBeside * *std::ranges::max_element(left));
  std::vector<std::size_t> far;
  std::ranges::copy_if(ran, std::back_inserter(far),
                       [&](std::size_t m) { return left[m] > small; });
  members.search_growing(far);
}

}  // namespace

void bring_near(const Study& study, const State& state, const MatrixXd& theta,
                const std::vector<Numerics>& variants, bool all,
                std::vector<std::optional<VectorXd>>& runs) {
  if (theta.cols() == 0) return;
  const std::vector<Index> times = nuisances_of_times(study.model());
  if (!times.empty()) {
    Members members(study, state, theta, variants, times, false, runs);
    const auto ran = members.that_ran(1, runs.size());
    if (!study.model().follows_recordings()) {
      members.search(ran, kRoundsOfTimes);
    } else if (!all) {
      members.step_without_runs(ran);
    }
  }
  if (!all) return;
  Members members(study, state, theta, variants, all_of(theta), true, runs);
  if (times.empty()) {
    adapt_all(study, members, runs.size());
  } else if (study.model().follows_recordings()) {
    search_farther_half(members, runs.size());
  }
  members.step_without_runs(members.that_ran(1, runs.size()));
}

}  // namespace matterfit::diagnose
