// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/diagnose.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>

#include "diagnose/extend.hpp"
#include "diagnose/localise.hpp"
#include "diagnose/next_recording.hpp"
#include "diagnose/starts.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Above it a cause that leaves the rest unexplained still stands as the finding.
constexpr double kExplainsEnough = 0.8;
/// The same of the whole misfit: what is left is as large as noise and solver make it, and its
/// smooth part, which is small beside it, may be the solver's.
constexpr double kLeavesNothing = 0.95;
/// The first on what was kept back, which is farther from what was fitted to.
constexpr double kPredictsEnough = 0.6;
/// Several causes that leave something else predict so much: numbers of unlike things together
/// imitate much of what none of them is.
constexpr double kTogetherPredict = 0.95;
/// The least gain, of its interval, at which a share kExplainsEnough of the whole misfit is enough.
constexpr double kSurelyPredicts = 0.5;
/// Power .8 of the detection limit: Φ⁻¹(.8).
constexpr double kPower = 0.84;
constexpr std::size_t kWorstFrames = 5;

ExtendOptions extend_options(const DiagnoseOptions& o) {
  ExtendOptions result;
  result.analysis.placebo.draws = o.draws;
  result.analysis.placebo.level = o.level;
  result.analysis.placebo.seed = o.seed;
  result.refit.iterations = o.iterations;
  result.refit.most_runs = o.most_runs;
  result.refit.differences.central = o.central;
  result.gain.seed = o.seed + 3;
  result.refits = o.refits;
  result.most_causes = o.most_causes;
  result.progress = o.progress;
  return result;
}

/// Fills a report from what the search found.
class Writer {
 public:
  Writer(const Study& study, const Extension& found, const DiagnoseOptions& options)
      : study_(study), model_(study.model()), found_(found), options_(options) {}

  Report write() {
    summarise();
    causes();
    decide();
    probabilities();
    // A refit says more than a score about causes that are hardly likely at all.
    const auto rank = [](const Cause& cause) {
      return std::tuple(!cause.accepted, -std::floor(1e6 * cause.probability), !cause.refitted,
                        -cause.probability);
    };
    std::ranges::stable_sort(report_.causes, {}, rank);
    report_.tested = int(report_.causes.size());
    if (report_.causes.size() > std::size_t(options_.listed)) {
      report_.causes.resize(std::size_t(options_.listed));
    }
    law();
    next();
    report_.runs = study_.runs();
    report_.cut = study_.cut();
    report_.began_elsewhere = found_.began_elsewhere;
    report_.by_stage.reserve(study_.stages().size());
    for (const Ledger::Stage& stage : study_.stages()) {
      report_.by_stage.emplace_back(stage.name, stage.runs);
    }
    report_.headline = headline(report_);
    return std::move(report_);
  }

 private:
  [[nodiscard]] const Effect& effect(const Candidate& candidate) const {
    return model_.effects()[std::size_t(candidate.effect)];
  }

  void summarise() {
    report_.shown = model_.shown();
    const Noise& noise = found_.noise;
    double variance = 0.0;
    double correlation = 0.0;
    double common = 0.0;
    double place = 0.0;
    for (const TrackNoise& track : noise.captures) {
      const double share = 1.0 / double(noise.captures.size());
      variance += share * track.sigma * track.sigma;
      correlation += share * track.correlation;
      common += share * track.common_sigma * track.common_sigma;
      place += share * track.place_sigma * track.place_sigma;
      report_.noise.kurtosis += share * track.kurtosis;
    }
    report_.noise.sigma = std::sqrt(variance);
    report_.noise.autocorrelation = correlation;
    report_.noise.common_sigma = std::sqrt(common);
    report_.noise.place_sigma = std::sqrt(place);
    const Eigen::MatrixXd solver = found_.spread.deviations();
    report_.numerical =
        root_mean_square(study_.used(), solver.topRows(study_.used().size()).rowwise().norm());
    const VectorXd residual = study_.measured() - found_.base.refit.prediction;
    const Index used = study_.used().size();
    report_.train = sizes_of(study_.used(), residual.head(used));
    report_.holdout = sizes_of(study_.held(), residual.tail(study_.held().size()));
    report_.by_frame = errors_by_frame(study_, residual, noise, solver);
    report_.worst = worst_frames(study_, residual, kWorstFrames);
    report_.wrong = wrong_places(study_, residual, noise, solver);
    for (const Capture& capture : model_.captures()) {
      report_.regions.push_back(region_names(capture));
    }
    report_.threshold = found_.first->placebo.threshold;
    report_.smooth_p = found_.first->smooth.p;
    report_.smooth_p_after = found_.last ? found_.last->smooth.p : found_.first->smooth.p;
    report_.bias = found_.best ? found_.best->refit.bias : found_.base.refit.bias;
    const SmoothTest& before = found_.first->smooth;
    if (found_.last && before.excess() > 0.0) {
      report_.explained =
          std::clamp(1.0 - found_.last->smooth.excess() / before.excess(), 0.0, 1.0);
    }
  }

  [[nodiscard]] const Trial* trial_of(const Candidate& candidate) const {
    for (const Trial& trial : found_.singles) {
      if (trial.causes.front().effect == candidate.effect) return &trial;
    }
    return nullptr;
  }

  /// Whether the best extension has this cause.
  [[nodiscard]] bool acts(const Candidate& candidate) const {
    return found_.best && std::ranges::count(found_.best->causes, candidate) > 0;
  }

  [[nodiscard]] std::vector<Value> values_of(const Candidate& candidate, const Refit& refit) const {
    std::vector<Value> values;
    Index at = 0;
    const double wide = std::sqrt(std::max(1.0, refit.chi_square / refit.freedom));
    for (const Active& active : refit.state.causes) {
      if (active.effect == candidate.effect) {
        const Effect& e = effect(candidate);
        for (std::size_t k = 0; k < e.numbers.size(); ++k) {
          values.push_back({e.numbers[k].name, e.numbers[k].unit, active.values[Index(k)],
                            wide * refit.error[at + Index(k)]});
        }
      }
      at += active.values.size();
    }
    return values;
  }

  void fill_gain(const Trial& trial, Cause& cause) const {
    const Gain& g = trial.gain;
    cause.holdout_before = g.before;
    cause.holdout_after = g.after;
    cause.holdout_floor = g.floor;
    cause.last_residual = g.last_residual;
    cause.free_field = g.free_field;
    cause.gain = g.value;
    cause.gain_low = g.low;
    cause.gain_high = g.high;
    cause.gain_measurable = g.measurable;
    cause.explained = std::clamp(share_of_excess(found_.base.refit, trial.refit), 0.0, 1.0);
  }

  void causes() {
    const std::vector<Score>& scores = found_.first->scores;
    double largest = 0.0;
    for (std::size_t k = 0; k < scores.size(); ++k) {
      const Score& score = scores[k];
      const Effect& e = effect(score.candidate);
      largest = std::max(largest, score.equivalent);
      // The shape that was refitted, else that of the largest score, stands for the effect.
      const Trial* trial = trial_of(score.candidate);
      const bool stands = acts(score.candidate) ||
                          (trial ? trial->causes.front().variant == score.candidate.variant
                                 : std::ranges::none_of(scores, [&](const Score& other) {
                                     return other.candidate.effect == score.candidate.effect &&
                                            (other.equivalent > score.equivalent ||
                                             (other.equivalent == score.equivalent &&
                                              other.candidate.variant < score.candidate.variant));
                                   }));
      if (!stands) continue;
      if (!score.observable && !trial) report_.not_observable.push_back(e.name);
      limits(k);
      report_.causes.push_back(row(k, trial));
    }
    report_.p = found_.first->placebo.p(largest);
  }

  [[nodiscard]] Cause row(std::size_t k, const Trial* trial) const {
    const Score& score = found_.first->scores[k];
    const Effect& e = effect(score.candidate);
    Cause cause;
    cause.effect_index = score.candidate.effect;
    cause.variant = score.candidate.variant;
    cause.effect = e.name;
    cause.scope = e.scope;
    cause.group = e.group;
    if (!e.variants.empty()) cause.where = e.variants[std::size_t(score.candidate.variant)];
    cause.score = score.statistic;
    cause.p = found_.first->placebo.p(score.equivalent);
    cause.keep = score.keep;
    cause.observable = score.observable || trial;
    cause.refitted = trial != nullptr;
    if (trial && !(e.onsets.empty() && e.tries.empty() && e.far_tries.empty())) {
      cause.p = found_.first->placebo.p(found_.base.evidence - trial->evidence);
    }
    if (acts(score.candidate)) {
      cause.parameters = values_of(score.candidate, found_.best->refit);
      fill_gain(*found_.best, cause);
    } else if (trial) {
      cause.parameters = values_of(score.candidate, trial->refit);
      fill_gain(*trial, cause);
    } else {
      for (std::size_t i = 0; i < e.numbers.size(); ++i) {
        const Number& number = e.numbers[i];
        cause.parameters.push_back({number.name, number.unit,
                                    number.neutral + number.scale * score.estimate[Index(i)],
                                    number.scale * score.error[Index(i)]});
      }
    }
    if (score.observable) {
      for (std::size_t l = 0; l < found_.first->scores.size(); ++l) {
        const Score& other = found_.first->scores[l];
        if (other.candidate.effect == score.candidate.effect) continue;
        const double cosine = std::sqrt(found_.first->test.imitation(k, score.estimate, l));
        // Nine tenths of the signature: the rest is what tells them apart.
        if (cosine > 0.9) {
          cause.confused_with.push_back(
              {effect(other.candidate).name, effect(other.candidate).scope, cosine});
        }
      }
      if (cause.p < options_.level) {
        cause.evidence_by_frame = evidence_by_frame(study_, *found_.first, k, score.estimate);
      }
    }
    if (found_.law && score.observable) {
      cause.absorbed = found_.law->absorbed[k];
    }
    cause.evidence = evidence(cause);
    cause.sentence = fill_sentence(e, cause);
    return cause;
  }

  [[nodiscard]] std::string evidence(const Cause& cause) const {
    if (!cause.observable) {
      return fmt::format(
          "Not observable here: {:.1f} % of its effect is left when the fitted "
          "parameters adapt.",
          100.0 * cause.keep);
    }
    if (cause.p >= options_.level) return "Not above what noise alone gives.";
    if (!cause.refitted) {
      const std::string& beside = model_.effects()[std::size_t(cause.effect_index)].beside;
      return beside.empty() ? "Its signature fits the residual less well than that of others."
                            : "Sought beside " + beside + " only.";
    }
    if (!cause.gain_measurable) {
      return fmt::format("Explains {:.0f} % of the excess; nothing held out can test it.",
                         100.0 * cause.explained);
    }
    return fmt::format("Explains {:.0f} % of the excess, and {:.0f} % of it on samples kept back.",
                       100.0 * cause.explained, 100.0 * cause.gain);
  }

  /// After the verdict: beside causes that are named, else by itself where something unknown is
  /// left. The model is extended by it in these cases alone.
  void law() {
    if (!found_.law) return;
    const FreeLaw& free = *found_.law;
    LawRow& row = report_.law.emplace();
    row.score = free.score.statistic;
    row.p = free.p;
    row.keep = free.score.keep;
    row.observable = free.score.observable;
    const bool named = !report_.classes.empty();
    const std::optional<LawTrial>& tried = named ? free.beside : free.alone;
    if (!tried || (!named && report_.verdict != Verdict::kUnknown)) return;
    row.refitted = true;
    row.end = tried->end;
    row.parameters = values_of(free.candidate, tried->trial.refit);
    row.explained = tried->explained;
    row.gain = tried->trial.gain.value;
    row.gain_low = tried->trial.gain.low;
    row.gain_high = tried->trial.gain.high;
    row.gain_measurable = tried->trial.gain.measurable;
    row.sentence = law_sentence(row, named);
    if (row.end != LawTrial::End::kImproves) return;
    extend_by(tried->trial.refit);
    // Values of what acts beside it are those that were fitted with it.
    for (Cause& cause : report_.causes) {
      if (!cause.accepted) continue;
      const Candidate candidate{cause.effect_index, cause.variant};
      cause.parameters = values_of(candidate, tried->trial.refit);
      cause.sentence = fill_sentence(effect(candidate), cause);
    }
  }

  void limits(std::size_t k) {
    const Score& score = found_.first->scores[k];
    if (!score.observable) return;
    const Effect& e = effect(score.candidate);
    for (std::size_t i = 0; i < e.numbers.size(); ++i) {
      const double error = found_.first->test.error_of(k, Index(i)) * e.numbers[i].scale;
      report_.detection_limits.push_back(
          {e.name, e.scope, e.numbers[i].name, e.numbers[i].unit,
           (std::sqrt(found_.first->placebo.threshold) + kPower) * error});
    }
  }

  /// Whether a refit leaves more than noise and solver make, outside contact. An error no larger
  /// than the solver's own is not known to be anything else, however unlike its members' patterns.
  [[nodiscard]] bool exceeds_solver(const Refit& refit) const {
    if (!found_.spread.known()) return true;
    const Rows& used = study_.used();
    VectorXd residual = (study_.measured() - refit.prediction).head(used.size());
    VectorXd usual =
        noise_sizes(used, found_.noise, found_.spread.deviations().topRows(used.size()));
    std::set<std::pair<int, Index>> contacts;
    for (const ContactFrame& contact : study_.model().contact_frames()) {
      contacts.insert({contact.capture, contact.frame});
    }
    for (const Series& series : used.series()) {
      for (Index i = series.begin; i < series.end; ++i) {
        if (contacts.contains({series.capture, used.frame(i)})) residual[i] = usual[i] = 0.0;
      }
    }
    return residual.squaredNorm() > usual.squaredNorm();
  }

  void decide() {
    const bool significant = report_.p < options_.level;
    const bool wrong = std::min(report_.smooth_p, report_.p) < options_.smooth_level;
    if (found_.accepted) {
      name_causes();
      const Gain& g = found_.best->gain;
      const bool predicts = !g.measurable || g.value >= kPredictsEnough;
      const bool several = found_.best->causes.size() > 1;
      const bool stands = predicts && (!several || !g.measurable || g.value >= kTogetherPredict);
      const bool left = report_.smooth_p_after < options_.smooth_level &&
                        (exceeds_solver(found_.best->refit) || !predicts);
      const double share = share_of_excess(found_.base.refit, found_.best->refit);
      const bool mostly = share >= kExplainsEnough && g.measurable && g.low >= kSurelyPredicts;
      const bool explains =
          report_.explained >= kExplainsEnough || share >= kLeavesNothing || mostly;
      report_.remains = left;
      if (left && (!explains || !stands)) {
        report_.verdict = Verdict::kUnknown;
        report_.classes.clear();
        for (Cause& cause : report_.causes) cause.accepted = false;
      }
    } else if (found_.within_solver || (wrong && !exceeds_solver(found_.base.refit)) ||
               (!wrong && !significant && found_.exact_solver_significant)) {
      report_.verdict = Verdict::kNumerical;
    } else if (wrong) {
      report_.verdict = Verdict::kUnknown;
    }
    report_.extended = found_.base.refit.state;
    if (report_.classes.empty()) return;
    extend_by(found_.best->refit);
  }

  void extend_by(const Refit& refit) {
    report_.extended = refit.state;
    const VectorXd left = study_.measured() - refit.prediction;
    const std::vector<FrameError> after =
        errors_by_frame(study_, left, found_.noise, found_.spread.deviations());
    for (std::size_t i = 0; i < after.size(); ++i) report_.by_frame[i].after = after[i].rms;
  }

  void name_causes() {
    const bool several = found_.best->causes.size() > 1;
    std::vector<const Cause*> members;
    for (Cause& cause : report_.causes) {
      const Candidate candidate{cause.effect_index, cause.variant};
      cause.accepted = acts(candidate);
      const bool rival = std::ranges::any_of(found_.rivals, [&](std::size_t k) {
        return found_.first->scores[k].candidate.effect == cause.effect_index;
      });
      if (cause.accepted || (!several && rival)) members.push_back(&cause);
    }
    std::ranges::stable_sort(members, [](const Cause* a, const Cause* b) {
      return a->accepted != b->accepted ? a->accepted : a->score > b->score;
    });
    bool measurement = true;
    for (const Cause* cause : members) {
      measurement = measurement && cause->group == "measurement";
      if (std::ranges::count(report_.classes, cause->effect) == 0) {
        report_.classes.push_back(cause->effect);
      }
    }
    report_.verdict = several                      ? Verdict::kSeveral
                      : measurement                ? Verdict::kMeasurement
                      : report_.classes.size() > 1 ? Verdict::kClass
                                                   : Verdict::kCause;
  }

  void probabilities() {
    const auto& effects = model_.effects();
    double priors = 0.0;
    for (const Cause& cause : report_.causes) {
      priors += effects[std::size_t(cause.effect_index)].prior;
    }
    const double share = 1.0 - options_.prior_nothing - options_.prior_unknown;
    const double tau = options_.temperature * found_.looseness;
    const double base = found_.base.evidence;
    double best = base;
    if (found_.best) best = std::min(best, found_.best->evidence);
    for (const Trial& trial : found_.singles) best = std::min(best, trial.evidence);
    const auto weight = [&](double prior, double evidence) {
      return prior * std::exp(-0.5 * (evidence - best) / tau);
    };
    const double nothing = weight(options_.prior_nothing, base);
    // The smooth residual as a model of so many numbers, each at the price of ln of what they see.
    const SmoothTest& smooth = found_.first->smooth;
    const double price = std::log(std::max(3.0, double(study_.used().size())));
    const double unknown =
        weight(options_.prior_unknown, base - smooth.statistic + price * double(smooth.freedom));
    const bool several = found_.best && found_.best->causes.size() > 1;
    double sum = nothing + unknown;
    for (Cause& cause : report_.causes) {
      const double prior =
          share * effects[std::size_t(cause.effect_index)].prior / std::max(priors, 1e-300);
      // A score is a linear promise: a cause that was not refitted counts as no better than one
      // that was.
      double evidence = std::max(best, base - cause.score + 2.0 * double(cause.parameters.size()));
      if (const Trial* trial = trial_of({cause.effect_index, cause.variant})) {
        evidence = trial->evidence;
      }
      if (!cause.observable) evidence = base + 2.0 * double(cause.parameters.size());
      const Candidate candidate{cause.effect_index, cause.variant};
      cause.probability = stands(model_, candidate, {}) ? weight(prior, evidence) : 0.0;
      if (!(several && cause.accepted)) sum += cause.probability;
    }
    double pair = 0.0;
    if (several) {
      // A second cause is one more draw from the catalogue.
      pair = weight(share * 0.2, found_.best->evidence);
      sum += pair;
    }
    for (Cause& cause : report_.causes) {
      cause.probability =
          several && cause.accepted ? pair / sum : std::min(1.0, cause.probability / sum);
    }
    report_.probability_nothing = nothing / sum;
    report_.probability_unknown = unknown / sum;
  }

  void next() {
    if (report_.classes.size() < 2 || report_.verdict == Verdict::kSeveral) return;
    std::vector<Rival> rivals;
    for (const std::size_t k : found_.rivals) {
      rivals.push_back({found_.first->scores[k].candidate, found_.first->scores[k].estimate});
    }
    report_.next_recording = separating_recording(study_, found_.slopes, found_.noise, rivals);
  }

  const Study& study_;
  const Model& model_;
  const Extension& found_;
  const DiagnoseOptions& options_;
  Report report_;
};

}  // namespace

Report diagnose(const Model& model, const DiagnoseOptions& options) {
  check(model);
  const Study study(model, options.limit);
  const Extension found = extend(study, options.members, extend_options(options));
  return Writer(study, found, options).write();
}

}  // namespace matterfit::diagnose
