// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/identify.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnose/analysis.hpp"
#include "diagnose/next_recording.hpp"
#include "diagnose/refit.hpp"
#include "diagnose/spread.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A direction that keeps less than a tenth of its members' information is a tie: errors are then
/// more than ten times what each alone would have.
constexpr double kTie = 0.1;
/// Components of a tied direction that count as its members.
constexpr double kMember = 0.3;
/// Shifts below an error are not worth a sentence.
constexpr double kNoticed = 1.0;
/// Half of the frames cost √2 in errors where frames are many: more than twice that, and what
/// happens between frames is what tells.
constexpr double kSparse = 2.8;
/// The second half of a recording is worth √2 of its own; from this on it is most of what tells.
constexpr double kShort = 4.0;
/// A new recording is proposed if it makes the worst error this much smaller.
constexpr double kHelps = 0.5;

/// (H)⁻¹ through unit diagonal, directions that nothing observes made infinite.
struct Inverse {
  MatrixXd covariance;
  MatrixXd directions;  ///< of the information with unit diagonal, smallest first
  VectorXd values;
  VectorXd keep;
};

Inverse invert(const MatrixXd& h, const VectorXd& whole) {
  const VectorXd unit = h.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(unit.asDiagonal() * h * unit.asDiagonal());
  Inverse result;
  result.directions = solver.eigenvectors();
  result.values = solver.eigenvalues();
  // Rounding of differences leaves this much of a direction that is not there.
  const VectorXd safe = result.values.cwiseMax(1e-12);
  const MatrixXd scaled = unit.asDiagonal() * result.directions;
  result.covariance = scaled * safe.cwiseInverse().asDiagonal() * scaled.transpose();
  result.keep = VectorXd::Zero(h.cols());
  for (Index i = 0; i < h.cols(); ++i) {
    if (whole[i] > 0.0) {
      result.keep[i] = std::min(1.0, 1.0 / std::sqrt(whole[i] * result.covariance(i, i)));
    } else if (h(i, i) <= 0.0) {
      result.covariance(i, i) = std::numeric_limits<double>::infinity();
    }
  }
  return result;
}

/// Effects that a fit takes not to be there, those of one shape. One of many shapes (a place, a
/// frequency, an onset) costs a simulation for each, and nobody knows before a recording which of
/// them it would have.
std::vector<Candidate> assumed_absent(const Model& model) {
  std::vector<Candidate> result;
  for (std::size_t e = 0; e < model.effects().size(); ++e) {
    const Effect& effect = model.effects()[e];
    if (effect.variants.size() <= 1 && effect.onsets.empty() && !effect.last) {
      result.push_back({int(e), 0});
    }
  }
  return result;
}

/// A study without held-out samples: simulations end where the samples do that a fit will see.
Study of_used(const Model& model, Index limit) {
  return {Study(model, limit), Rows(model.captures(), Use::kUsed, limit),
          Rows(model.captures(), [](int, Index, Index) { return false; })};
}

class Check {
 public:
  Check(const Model& model, const IdentifyOptions& options)
      : model_(model), study_(of_used(model, options.limit)), progress_(options.progress) {
    differences_.central = options.central;
    differences_.numbers = 1;  // what is not there is tried in one direction
  }

  BeforeFit run() {
    tell(0.0, "Differentiating");
    const State state = study_.fitted();
    slopes_ = linearise(study_, state, assumed_absent(model_), differences_);
    measure_noise();
    const Index used = study_.used().size();
    MatrixXd members(used, 0);
    tell(0.8, "Measuring the solver's own error");
    const Spread spread = numerical_spread(study_, state, slopes_.theta,
                                           {.members = 2, .directions = false, .adapted = false});
    if (spread.members.cols() > 0) members = spread.members.topRows(used);
    if (spread.bias.size() > 0) {
      members.conservativeResize(used, members.cols() + 1);
      members.rightCols(1) = spread.bias.head(used);
    }
    const Whitening whitening(study_.used(), noise_, members);
    white_ = whitening.apply(slopes_.theta.topRows(used));
    MatrixXd h = white_.transpose() * white_;
    gram_ = h;
    whole_ = h.diagonal();
    h.diagonal() += theta_prior(model_).precision;
    inverse_ = invert(h, whole_);
    parameters();
    ties();
    sufficiency();
    assumptions(whitening);
    propose();
    speak();
    return std::move(result_);
  }

 private:
  void tell(double fraction, const std::string& what) const {
    if (progress_) progress_(fraction, what);
  }

  void measure_noise() {
    const Spread none = Spread::none(study_.size());
    const VectorXd left = (study_.measured() - slopes_.prediction).head(study_.used().size());
    noise_ = estimate_noise(study_.used(), model_.captures(), left,
                            explained_columns(study_, slopes_, none, left), 1e-7,
                            body_turns(study_.used(), model_.captures(),
                                       slopes_.prediction.head(study_.used().size())));
    for (std::size_t c = 0; c < noise_.captures.size(); ++c) {
      const double stated = model_.captures()[c].noise;
      if (stated > 0.0) noise_.captures[c].sigma = stated;
    }
    noise_.weights.setOnes();
    result_.sigma = noise_.captures.front().sigma;
    result_.autocorrelation = noise_.captures.front().correlation;
  }

  /// Physical size of one scale of a parameter at the start.
  [[nodiscard]] double physical(const fit::Parameter& parameter) const {
    const double natural = fit::to_natural(parameter.coordinate, parameter.start);
    return fit::derivative(parameter.coordinate, natural) * parameter.scale;
  }

  [[nodiscard]] double scaled_error(Index i) const { return std::sqrt(inverse_.covariance(i, i)); }

  void parameters() {
    for (std::size_t p = 0; p < model_.parameters().size(); ++p) {
      const fit::Parameter& parameter = model_.parameters()[p];
      const double error = scaled_error(Index(p));
      result_.parameters.push_back({parameter.name, parameter.unit, parameter.start,
                                    error * physical(parameter), inverse_.keep[Index(p)],
                                    error < 1.0});
    }
  }

  void ties() {
    for (Index k = 0; k < inverse_.values.size(); ++k) {
      const double keep = std::sqrt(std::max(inverse_.values[k], 0.0));
      if (keep >= kTie) break;
      Tie tie;
      tie.keep = keep;
      for (Index i = 0; i < inverse_.values.size(); ++i) {
        if (std::abs(inverse_.directions(i, k)) > kMember) {
          tie.names.push_back(model_.parameters()[std::size_t(i)].name);
        }
      }
      if (tie.names.size() > 1) result_.ties.push_back(std::move(tie));
    }
  }

  /// Whether half of it would do, by the rows that would be left.
  void sufficiency() {
    double first = 1e300;
    double last = -1e300;
    for (Index i = 0; i < white_.rows(); ++i) {
      first = std::min(first, study_.used().time(i));
      last = std::max(last, study_.used().time(i));
    }
    Enough rate = without("frame rate", [&](Index i) { return study_.used().frame(i) % 2 == 0; });
    rate.enough = rate.ratio < kSparse;
    rate.sentence = rate.enough
                        ? "The frame rate suffices."
                        : fmt::format(
                              "The frame rate hardly suffices: at half of it {} would be {:.1f} "
                              "times as uncertain. Record more frames a second.",
                              rate.parameter, rate.ratio);
    Enough span =
        without("duration", [&](Index i) { return study_.used().time(i) <= 0.5 * (first + last); });
    span.enough = span.ratio < kShort;
    span.sentence =
        span.enough
            ? "The recording is long enough."
            : fmt::format(
                  "Most of what identifies {} is in the second half of the recording: without "
                  "it, it would be {:.1f} times as uncertain. A longer one would show more.",
                  span.parameter, span.ratio);
    result_.enough.push_back(std::move(rate));
    result_.enough.push_back(std::move(span));
    Enough noise{"noise", 1.0, "", true, "The noise is small enough."};
    for (std::size_t p = 0; p < result_.parameters.size(); ++p) {
      const double error = scaled_error(Index(p));
      if (!std::isfinite(error) || error <= noise.ratio) continue;
      noise.ratio = error;
      noise.parameter = result_.parameters[p].name;
      noise.enough = false;
    }
    if (!noise.enough) {
      noise.sentence = fmt::format(
          "With {:.2g} m of noise {} is not identified; it would take {:.2g} m, or so many more "
          "points.",
          result_.sigma, noise.parameter, result_.sigma / noise.ratio);
    }
    result_.enough.push_back(std::move(noise));
  }

  template <class Keep>
  [[nodiscard]] Enough without(const char* what, const Keep& keep) const {
    MatrixXd h = MatrixXd::Zero(white_.cols(), white_.cols());
    for (Index i = 0; i < white_.rows(); ++i) {
      if (keep(i)) h += white_.row(i).transpose() * white_.row(i);
    }
    const VectorXd whole = h.diagonal();
    h.diagonal() += theta_prior(model_).precision;
    const Inverse inverse = invert(h, whole);
    Enough result{what, 1.0, "", true, ""};
    for (Index i = 0; i < h.cols(); ++i) {
      const double before = scaled_error(i);
      const double after = std::sqrt(inverse.covariance(i, i));
      // What is not identified at all is said elsewhere.
      if (!(before < 1.0) || !(after > result.ratio * before)) continue;
      result.ratio = after / before;
      result.parameter = model_.parameters()[std::size_t(i)].name;
    }
    return result;
  }

  /// θ shifts by H⁻¹ Jᵀ j when an effect of one scale is there and is left out.
  void assumptions(const Whitening& whitening) {
    const Index used = study_.used().size();
    for (const Linearised::Column& column : slopes_.columns) {
      if (column.values.cols() == 0 || white_.cols() == 0) continue;
      const Effect& effect = model_.effects()[std::size_t(column.candidate.effect)];
      const VectorXd white = whitening.apply(column.values.col(0).head(used));
      const VectorXd shift = inverse_.covariance * (white_.transpose() * white);
      Assumption worst;
      worst.effect = effect.name;
      worst.size = fmt::format("{:g}{}{}", effect.numbers[0].scale,
                               effect.numbers[0].unit.empty() ? "" : " ", effect.numbers[0].unit);
      for (Index i = 0; i < shift.size(); ++i) {
        const double errors = std::abs(shift[i]) / scaled_error(i);
        if (!(errors > worst.errors)) continue;
        worst.errors = errors;
        worst.parameter = model_.parameters()[std::size_t(i)].name;
        worst.shift = shift[i] * physical(model_.parameters()[std::size_t(i)]);
      }
      if (worst.errors > kNoticed) result_.assumptions.push_back(std::move(worst));
    }
    std::ranges::stable_sort(result_.assumptions, [](const Assumption& a, const Assumption& b) {
      return a.errors > b.errors;
    });
  }

  void propose() {
    const auto worst = [](const Inverse& inverse, const std::vector<Index>& which) {
      double most = 0.0;
      for (const Index i : which) most = std::max(most, std::sqrt(inverse.covariance(i, i)));
      return most;
    };
    const std::vector<int> own = model_.own_capture();
    const Index p = Index(own.size());
    // A throw of its own is not what one makes another recording for.
    std::vector<Index> shared;
    for (Index i = 0; i < p; ++i) {
      if (own[std::size_t(i)] < 0) shared.push_back(i);
    }
    const bool told = result_.ties.empty() &&
                      std::ranges::all_of(result_.parameters, [](const Identifiable& parameter) {
                        return parameter.known;
                      });
    if (shared.empty() || told) return;
    const double now = worst(inverse_, shared);
    double best = now * kHelps;
    const std::vector<Experiment> experiments = model_.experiments();
    for (std::size_t e = 0; e < experiments.size(); ++e) {
      const MatrixXd fresh = experiment_gram(study_, int(e), {}, noise_);
      if (fresh.size() == 0) continue;
      MatrixXd sum = join_recordings(gram_, fresh, p, own);
      const VectorXd whole = sum.diagonal();
      sum.diagonal().head(p) += theta_prior(model_).precision;
      const double then = worst(invert(sum, whole), shared);
      if (then < best) {
        best = then;
        result_.record_instead = experiments[e].sentence;
      }
    }
  }

  void speak() {
    for (const Identifiable& parameter : result_.parameters) {
      if (parameter.known) continue;
      result_.statements.push_back(
          std::isfinite(parameter.error)
              ? fmt::format(
                    "{} cannot be identified from this recording: its error would be {:.2g} {}.",
                    parameter.name, parameter.error, parameter.unit)
              : fmt::format("{} does not change anything that was recorded.", parameter.name));
    }
    for (const Tie& tie : result_.ties) {
      std::string names;
      for (std::size_t i = 0; i < tie.names.size(); ++i) {
        names += (i == 0 ? "" : (i + 1 == tie.names.size() ? " and " : ", ")) + tie.names[i];
      }
      result_.statements.push_back(fmt::format(
          "{} are tied: the recording identifies only a combination of them. Give one of them.",
          names));
    }
    for (const Enough& enough : result_.enough) {
      if (!enough.enough) result_.statements.push_back(enough.sentence);
    }
    for (std::size_t i = 0; i < std::min<std::size_t>(3, result_.assumptions.size()); ++i) {
      const Assumption& a = result_.assumptions[i];
      std::string effect = a.effect;
      std::ranges::replace(effect, '_', ' ');
      result_.statements.push_back(
          fmt::format("An unnoticed {} of {} would move {} by {:.2g}, {:.0f} of its errors.",
                      effect, a.size, a.parameter, a.shift, a.errors));
    }
    if (!result_.record_instead.empty()) result_.statements.push_back(result_.record_instead);
  }

  const Model& model_;
  Study study_;
  DifferenceOptions differences_;
  Linearised slopes_;
  Noise noise_;
  MatrixXd white_;
  MatrixXd gram_;
  VectorXd whole_;
  Inverse inverse_;
  BeforeFit result_;
  std::function<void(double, const std::string&)> progress_;
};

}  // namespace

BeforeFit identify(const Model& model, const IdentifyOptions& options) {
  check(model);
  return Check(model, options).run();
}

}  // namespace matterfit::diagnose
