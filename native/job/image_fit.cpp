// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "base/clock.hpp"
#include "base/error.hpp"
#include "base/file.hpp"
#include "fit/numerics/uncertainty.hpp"
#include "fit/search/value_errors.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/inputs.hpp"
#include "job/fit_files.hpp"
#include "job/fit_state.hpp"
#include "job/fit_weights.hpp"
#include "job/image_experiment.hpp"
#include "job/image_fit_end.hpp"
#include "job/image_fit_report.hpp"
#include "job/image_fit_state.hpp"
#include "job/image_weights.hpp"
#include "job/run/folder_lock.hpp"
#include "job/run/stage.hpp"

namespace matterfit::job {
namespace {

constexpr double kNoMisfit = std::numeric_limits<double>::quiet_NaN();
constexpr double kNarrow = 1.0;  ///< blurs [reduced pixels]
constexpr double kWide = 4.0;
/// Shares of the images after the scene's first frame by which the throw is looked for, one after
/// another; at least so many times.
constexpr double kBeginnings[] = {0.1, 0.2, 0.35};
constexpr std::size_t kFewestTimes = 2;
/// A longer beginning whose misfit is this many times that of the one before, which counts as
/// kAgrees at least, is none of a throw alone.
constexpr double kDisagrees = 4.0;
constexpr double kAgrees = 0.1;
/// The separation that tells what the grid makes of values, as a multiple of the fit's, and what
/// the fit has of the difference. Outlines of bodies twice as coarse are no small change any more.
constexpr double kCoarser = 1.26;
constexpr double kOfCoarser = 1.0 / (kCoarser * kCoarser - 1.0);
/// Factors at which a stiffness is tried that nothing is known of.
constexpr double kScan[] = {1.0 / 64, 1.0 / 16, 0.25, 4.0, 16.0, 64.0};

/// One fit of a job's images and, where it has any, tracks.
class ImageFit {
 public:
  ImageFit(const Job& job, const RunOptions& options, Interrupter& interrupter)
      : job_(job),
        doc_(fit_of(job)),
        options_(options),
        interrupter_(interrupter),
        end_(job, doc_, options) {}

  Json run() {
    if (!doc_.laws.empty()) {
      throw_input("fit.laws: laws are compared by tracks only; a fit to images takes one.");
    }
    if (doc_.correction > 0) {
      throw_input("fit.correction: it is judged by tracks only; leave it out of a fit to images.");
    }
    say("Reading", 0.0);
    state_.inputs = fit_inputs(job_, resolve_target(options_.target));
    state_.input_hash = hash_inputs(state_.inputs);
    lock_.emplace(job_.output.folder);
    const std::optional<Fitted> fitted = find_start();
    if (fitted) {
      Json document = fitted->document;
      // It may have been moved since.
      document["output"]["folder"] = job_.output.folder.generic_string();
      return simulate(document, fitted->fit);
    }
    try {
      return fit();
    } catch (const Error& error) {
      // Nothing is known of a fit whose start has not been simulated.
      if (error.kind() != ErrorKind::kCancelled || !scene_ || state_.before.is_null()) throw;
      return cancelled(error);
    }
  }

 private:
  void say(const std::string& label, double fraction) {
    enter_stage(interrupter_, label, fraction);
  }

  Json fit() {
    say("Filling bodies", 0.0);
    scene_.emplace(job_, doc_, options_, interrupter_, statements_);
    started_ = Clock::now();
    begin();
    while (state_.phase != ImagePhase::kDone) {
      pass(state_.phase);
      state_.phase = static_cast<ImagePhase>(static_cast<int>(state_.phase) + 1);
      // The errors are those of the last search.
      if (state_.phase != ImagePhase::kDone) state_.search.reset();
      state_.refinements.clear();
      save();
    }
    const std::optional<ImageWeights> more = further();
    say("Fitting: errors of the values", 0.95 * kImageFitShare);
    const std::optional<fit::Uncertainty> known = uncertainty();
    const ImageStanding after = scene_->standing(state_.values);
    if (more) {
      // A fit that is taken up goes on with weights from where its numbers ended.
      state_.seconds += seconds_since(started_);
      write_history(job_.output.folder, state_.history);
    } else {
      save();
    }
    Json document = end_.document(*scene_, scene_->parameters(), state_.values);
    if (more && more->taken) write_image_weights(*more, job_, document);
    Json fit = image_fit_json(
        {job_, doc_, *scene_, scene_->parameters(), state_, misfit_, known, after}, statements_);
    if (more) fit["weights"] = more->report;
    write_fitted(job_.output.folder, {state_.input_hash, state_.inputs, document, fit});
    // Only now: until then the search would go on from it.
    std::error_code code;
    std::filesystem::remove(job_.output.folder / kFitCheckpointPath, code);
    return simulate(document, fit);
  }

  Json simulate(const Json& document, const Json& fit) {
    lock_.reset();  // the run takes it again
    return end_.simulate(document, fit, interrupter_);
  }

  /// The best values of a search that was broken off; the checkpoint stays. Of one that moved
  /// weights the numbers as they were before that.
  Json cancelled(const Error& error) {
    if (!numbers_) state_.values = best_values(state_);
    const fit::Parameters& parameters = numbers_ ? numbers_->parameters : scene_->parameters();
    const ImageFitState& state = numbers_ ? numbers_->state : state_;
    Json fit = image_fit_json({job_, doc_, *scene_, parameters, state, misfit_, std::nullopt, {}},
                              numbers_ ? numbers_->statements : statements_);
    fit["converged"] = false;
    fit["reason"] = "Cancelled; these are the best values so far.";
    fit["warning"] = kCancelledWarning;
    if (state.phase <= ImagePhase::kThrow) {
      fit["statements"].push_back(
          "So far only cameras' poses and the throw were looked for; all other numbers are those "
          "that the fit began with.");
    }
    return end_.unfinished(end_.document(*scene_, parameters, state.values), std::move(fit), error);
  }

  /// Takes up what the folder holds of this fit; where its search is done, that. Throws
  /// Error(kInput) where it holds something else that may not be replaced.
  [[nodiscard]] std::optional<Fitted> find_start() {
    const std::filesystem::path& folder = job_.output.folder;
    const bool afresh = options_.restart == Restart::kAlways;
    auto state = afresh ? std::nullopt : read_image_fit_state(folder);
    auto fitted = afresh ? std::nullopt : read_fitted(folder);
    if (state && state->input_hash == state_.input_hash) {
      state_ = std::move(*state);
      resumed_ = true;
      return std::nullopt;
    }
    if (fitted && fitted->input_hash == state_.input_hash) return fitted;
    if (options_.restart == Restart::kNever) refuse_what_is_there(folder, state_.inputs);
    // Cancelled before its first checkpoint a fit must not go on from what it was to replace.
    for (const char* old : {kFitCheckpointPath, kFittedPath}) {
      std::error_code code;
      std::filesystem::remove(folder / old, code);
    }
    return std::nullopt;
  }

  /// At the start, or where the checkpoint was written.
  void begin() {
    if (!resumed_) {
      say("Fitting: the start", 0.01);
      state_.values = scene_->parameters().starts();
      settle_steps();
      settle_sizes();
      const ImageStanding before = scene_->standing(state_.values);
      state_.before = {{"silhouettes", before.silhouettes}, {"tracks", before.tracks}};
      save();
      return;
    }
    say("Fitting: going on", searched());
    settle_as_kept();
  }

  /// Settles substeps, sizes and colours at the values that the checkpoint keeps for each.
  void settle_as_kept() {
    scene_->settle_steps(state_.stepped_at);
    scene_->settle_sizes(state_.sized_at);
    if (!state_.coloured_at.empty()) scene_->learn_colours(state_.coloured_at);
  }

  void settle_steps() {
    scene_->settle_steps(state_.values);
    state_.stepped_at = state_.values;
  }

  void settle_sizes() {
    scene_->settle_sizes(state_.values);
    state_.sized_at = state_.values;
  }

  void learn_colours() {
    if (scene_->learn_colours(state_.values)) state_.coloured_at = state_.values;
  }

  /// The problem of all that is fitted, from the present values on.
  [[nodiscard]] fit::ImageProblem problem(double blur) {
    return watched(scene_->problem(state_.values, blur));
  }

  /// The fraction of the whole that the searches have come to.
  [[nodiscard]] double searched() const {
    return 0.9 * kImageFitShare * searched_share(state_.simulated, scene_->parameters().size());
  }

  [[nodiscard]] fit::ImageProblem watched(fit::ImageProblem problem) {
    problem.simulated = [this, before = 0](int count) mutable {
      state_.simulated += cost_of(state_.phase) * (count - before);
      before = count;
      say("Fitting", searched());
    };
    return problem;
  }

  void pass(ImagePhase phase) {
    switch (phase) {
      case ImagePhase::kPosesWide:
        find_poses(kWide);
        break;
      case ImagePhase::kPosesNarrow:
        find_poses(kNarrow);
        break;
      case ImagePhase::kThrow:
        // Taken up later, they are those of where it began.
        if (state_.beginnings == 0 && !state_.search) learn_colours();
        find_throw();
        break;
      case ImagePhase::kScan:
        scan();
        break;
      case ImagePhase::kWide:
        search(kWide, "wide");
        if (scene_->moves_cameras()) settle_sizes();
        learn_colours();
        break;
      case ImagePhase::kNarrow:
        search(kNarrow, "narrow");
        break;
      case ImagePhase::kDone:
        break;
    }
  }

  void save() {
    state_.seconds += seconds_since(started_);
    started_ = Clock::now();
    write_history(job_.output.folder, state_.history);
    write_file(job_.output.folder / kFitCheckpointPath, format_image_fit_state(state_));
  }

  /// Poses of cameras from the images at the scene's first frame: nothing has moved there, so they
  /// tell of poses and of where the bodies stand alone, and cost no simulation.
  void find_poses(double blur) {
    if (!scene_->sees_first_frame() || !scene_->moves_cameras()) return;
    search(watched(scene_->first_frame(state_.values, blur)), "poses",
           scene_->parameters_from(state_.values));
    settle_sizes();
  }

  /// The throw from the images after the first: with few cameras a wrong one leads all later images
  /// astray, and what it displaces is then taken for the material. Tracks tell it themselves.
  void find_throw() {
    const std::vector<double> times = scene_->later_times();
    if (scene_->has_tracks() || !scene_->finds_throw() || times.empty()) return;
    const auto count_of = [&](int beginning) {
      const auto wanted =
          static_cast<std::size_t>(std::ceil(kBeginnings[beginning] * double(times.size())));
      return std::min(std::max(wanted, kFewestTimes), times.size());
    };
    while (state_.beginnings < static_cast<int>(std::size(kBeginnings))) {
      const std::size_t count = count_of(state_.beginnings);
      if (state_.beginnings > 0 && count == count_of(state_.beginnings - 1)) {
        ++state_.beginnings;
        continue;
      }
      const std::vector<double> before = state_.values;
      const fit::ImageProblem::Misfit ended =
          search(watched(scene_->beginning(state_.values, kWide, times[count - 1])), "throw",
                 scene_->motion_from(state_.values));
      const double misfit = std::fmax(ended.images, ended.colours);  // the one that is no NaN
      if (state_.agreed && misfit > kDisagrees * std::max(*state_.agreed, kAgrees)) {
        // A contact, say, came in between and tells more of the material, which is held here.
        state_.values = before;
        state_.beginnings = static_cast<int>(std::size(kBeginnings)) - 1;
      } else {
        state_.agreed = misfit;
      }
      ++state_.beginnings;
      state_.search.reset();
      state_.refinements.clear();
      save();
    }
  }

  /// Starts of stiffness that nothing is known of: the best of some factors off the scene's.
  void scan() {
    fit::ImageProblem at = problem(kWide);
    for (std::size_t k = 0; k < state_.values.size(); ++k) {
      const fit::Address& path = scene_->parameters().path(k);
      const bool given = std::any_of(doc_.parameters.begin(), doc_.parameters.end(),
                                     [&](const fit::ParameterSpec& spec) {
                                       return !spec.start.empty() && spec.path.same_number(path);
                                     });
      if (!path.quantity->scanned || given) continue;
      const fit::Parameter& parameter = scene_->parameters().parameters()[k];
      std::vector<std::vector<double>> tried{state_.values};
      for (const double factor : kScan) {
        const double value = state_.values[k] * factor;
        if (value <= parameter.low || value >= parameter.high) continue;
        tried.push_back(state_.values);
        tried.back()[k] = value;
      }
      std::vector<Eigen::VectorXd> points;
      points.reserve(tried.size());
      for (const auto& values : tried) points.push_back(scene_->natural(values));
      const auto residuals = at.evaluate(points);
      double best = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < tried.size(); ++i) {
        if (!residuals[i] || !(residuals[i]->squaredNorm() < best)) continue;
        best = residuals[i]->squaredNorm();
        state_.values = tried[i];
      }
      state_.evaluations += static_cast<int>(tried.size());
    }
  }

  /// Refines the plan as the values now need it; residuals are then not quite the same.
  void settle(fit::ImageProblem& at, fit::LeastSquaresState& search) {
    fit::StepPlan plan = at.plan();
    scene_->model().settle(plan, at.physical(search.point), at.plan().refinements);
    state_.refinements = plan.refinements;
    if (plan.refinements == at.plan().refinements) return;
    at.set_plan(std::move(plan));
    search.residual.resize(0);
    search.forget_slopes();
  }

  void search(double blur, const char* stage) {
    // A search that is taken up has its substeps.
    if (!state_.search) settle_steps();
    search(problem(blur), stage, scene_->parameters_from(state_.values));
  }

  /// The misfit where it ended.
  fit::ImageProblem::Misfit search(fit::ImageProblem at, const char* stage,
                                   std::vector<fit::Parameter> parameters) {
    if (parameters.empty()) return {kNoMisfit, kNoMisfit, kNoMisfit};  // weights alone are fitted
    fit::LeastSquaresOptions options;
    options.huber = doc_.huber;
    options.iterations = doc_.iterations;
    search_.emplace(std::move(parameters), options);
    if (state_.search) {
      fit::StepPlan plan = at.plan();
      if (state_.refinements.size() == plan.refinements.size()) {
        plan.refinements = state_.refinements;
        at.set_plan(std::move(plan));
      }
    } else {
      state_.search = search_->start();
    }
    fit::LeastSquaresState& search = *state_.search;
    while (!search.finished) {
      if (search.residual.size() > 0) misfit_ = at.misfit(search.residual);
      settle(at, search);
      try {
        search_->iterate(at, search);
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::kCompute || at.failure().empty()) throw;
        throw_compute(std::string(error.what()) + " " + at.failure());
      }
      state_.history.push_back({{"stage", stage},
                                {"iteration", search.iteration},
                                {"cost", search.cost},
                                {"values", at.physical(search.point)}});
      save();
    }
    state_.values = at.physical(search.point);
    state_.evaluations += search.evaluations;
    state_.iterations += search.iteration;
    return at.misfit(search.residual);
  }

  /// The search goes on with the weights of a neural law, where the document asks for it.
  [[nodiscard]] std::optional<ImageWeights> further() {
    if (doc_.weights == 0) return std::nullopt;
    ImageWeightsStart from;
    from.values = state_.values;
    from.iterations = doc_.weights;
    from.blur = kNarrow;
    from.options.huber = doc_.huber;
    from.options.iterations = doc_.weights;
    from.tell = [this](int) { say("Fitting: weights", 0.92 * kImageFitShare); };
    from.body = body_with_weights(job_, fitted_bodies(doc_, job_.scene.bodies.front().name));
    if (from.body.empty()) {
      statements_.push_back(kNoWeights);
      return std::nullopt;
    }
    search_.reset();
    numbers_.emplace(Numbers{scene_->parameters(), state_, statements_});
    ImageWeights more = fit_image_weights(*scene_, from, state_.history);
    statements_.push_back(more.statement);
    state_.evaluations += more.evaluations;
    state_.iterations += more.report.at("iterations").get<int>();
    if (more.taken) {
      state_.values = more.values;
      begin_errors();
    }
    settle_steps();
    return more;
  }

  /// The errors are those of the present values, whatever their search was.
  void begin_errors() {
    if (state_.values.empty()) return;
    search_.emplace(scene_->parameters_from(state_.values), fit::LeastSquaresOptions{});
    fit::LeastSquaresState at = search_->start();
    if (state_.search) {
      at.finish(state_.search->converged, state_.search->reason);
    } else {
      at.finish(true, "Its weights alone were moved.");
    }
    state_.search = std::move(at);
    state_.refinements.clear();
  }

  [[nodiscard]] std::optional<fit::Uncertainty> uncertainty() {
    if (state_.values.empty()) return std::nullopt;
    fit::ImageProblem at = scene_->problem(state_.values, kNarrow);
    // Taken up after the last search.
    if (!search_)
      search_.emplace(scene_->parameters_from(state_.values), fit::LeastSquaresOptions{});
    settle(at, *state_.search);
    search_->linearise(at, *state_.search);
    misfit_ = at.misfit(state_.search->residual);
    // Without Huber's bound, which is one of residuals that are not counted yet.
    fit::Uncertainty known =
        fit::uncertainty(search_->parameters(), at.as_counted(*state_.search),
                         at.effective(state_.search->residual), 0.0, at.blocks());
    const auto change = fit::grid_change(
        state_.search->residual,
        [&] {
          return scene_->residuals_at(kCoarser, state_.values, kNarrow,
                                      [this] { settle_as_kept(); });
        },
        statements_);
    if (change) {
      fit::add_grid_error(search_->parameters(), *state_.search, *change, kOfCoarser, 0.0, known);
    }
    return known;
  }

  const Job& job_;
  const FitDoc& doc_;
  RunOptions options_;
  Interrupter& interrupter_;
  const FittedImages end_;
  std::vector<std::string> statements_;
  std::optional<ImageExperiment> scene_;
  std::optional<fit::LeastSquares> search_;
  fit::ImageProblem::Misfit misfit_{kNoMisfit, kNoMisfit, kNoMisfit};
  ImageFitState state_;
  bool resumed_ = false;
  /// The fit as it stood before weights were moved.
  struct Numbers {
    fit::Parameters parameters;
    ImageFitState state;
    std::vector<std::string> statements;
  };
  std::optional<Numbers> numbers_;
  std::optional<FolderLock> lock_;
  Clock::time_point started_;
};

}  // namespace

Json run_image_fit(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  return ImageFit(job, options, interrupter).run();
}

}  // namespace matterfit::job
