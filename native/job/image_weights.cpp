// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_weights.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "job/fit_published.hpp"
#include "job/fit_published_search.hpp"
#include "job/fit_weights.hpp"
#include "material/neural/isotropic_material.hpp"

namespace matterfit::job {
namespace {

using material::PublishedLaw;

/// So many steps that predict worse end the search.
constexpr int kMostWorseSteps = 4;

/// How far outlines are from agreeing: 1 − IoU.
std::optional<double> outlines_apart(const Json& silhouettes, const char* which) {
  const Json& one = silhouettes.at(which);
  if (!one.contains("iou")) return std::nullopt;
  return 1.0 - one.at("iou").get<double>();
}

Json both_ious(const std::optional<double>& without, const std::optional<double>& with) {
  const auto number = [](const std::optional<double>& value) {
    return value ? Json(1.0 - *value) : Json();
  };
  return {{"without", number(without)}, {"with", number(with)}};
}

/// Steps of a fit to images.
class ImageSteps final : public PublishedSteps {
 public:
  ImageSteps(ImageExperiment& experiment, const ImageWeightsStart& from, std::vector<Json>& history)
      : experiment_(experiment), from_(from), history_(history) {}

  void begin(std::shared_ptr<const PublishedLaw> law, const std::vector<double>& values) override {
    const std::size_t moves = law->directions.size();
    begin(
        [&](fit::SceneBuilder build) { return with_published(std::move(build), from_.body, law); },
        weight_moves_of(from_.body, 0, moves), values);
  }

  /// From values of its own numbers on, with further ones that are 0.
  void begin(const std::function<fit::SceneBuilder(fit::SceneBuilder)>& with,
             std::vector<fit::ParameterSpec> more, std::vector<double> values) {
    problem_.reset();
    values.resize(values.size() + more.size(), 0.0);
    values_ = std::move(values);
    state_ = {};
    experiment_.extend(with, std::move(more));
    experiment_.settle_steps(values_);
    if (values_.empty()) return;
    problem_.emplace(experiment_.problem(values_, from_.blur));
    problem_->simulated = from_.tell;
    search_.emplace(experiment_.parameters_from(values_), from_.options);
    state_ = search_->start();
  }

  [[nodiscard]] FurtherMeans means() override {
    const Json silhouettes = experiment_.standing(values_).silhouettes;
    return {outlines_apart(silhouettes, "held_out"), outlines_apart(silhouettes, "fitted")};
  }

  int steps(int most) override {
    if (!problem_) return 0;
    while (!state_.finished && state_.iteration < most) {
      const int known = state_.iteration;
      search_->iterate(*problem_, state_);
      if (state_.iteration == known) continue;
      values_ = problem_->physical(state_.point);
      history_.push_back({{"stage", "weights"},
                          {"iteration", state_.iteration},
                          {"cost", state_.cost},
                          {"values", values_}});
    }
    return state_.iteration;
  }

  [[nodiscard]] const std::vector<double>& values() const override { return values_; }

  [[nodiscard]] std::vector<double> slope() override {
    if (!problem_) return {};
    if (state_.residual.size() == 0) {
      const auto found = problem_->evaluate({state_.point});
      ++state_.evaluations;
      if (!found.front()) return {};
      state_.residual = *found.front();
    }
    auto slope = problem_->transposed_published(state_.point, state_.residual, from_.body);
    return slope ? std::move(*slope) : std::vector<double>();
  }

  [[nodiscard]] int evaluations() const override { return state_.evaluations; }
  [[nodiscard]] bool finished() const { return state_.finished; }
  /// The experiment as it was.
  void leave() {
    problem_.reset();
    experiment_.extend({}, {});
  }

 private:
  ImageExperiment& experiment_;
  const ImageWeightsStart& from_;
  std::vector<Json>& history_;
  std::optional<fit::ImageProblem> problem_;
  std::optional<fit::LeastSquares> search_;
  fit::LeastSquaresState state_;
  std::vector<double> values_;
};

/// What is found, and by how much nearer it is.
struct Found {
  int steps = 0;
  FurtherMeans without;
  FurtherMeans best;
};

Found move_isotropic(ImageSteps& steps, const ImageWeightsStart& from, ImageWeights& result) {
  const auto with = [&](fit::SceneBuilder build) {
    return with_weight_moves(std::move(build), from.body);
  };
  const auto moves = weight_moves_of(from.body, 1, material::kIsotropicElastic);
  steps.begin(with, moves, from.values);
  Found found;
  found.without = found.best = steps.means();
  int worse = 0;
  while (found.without.seen && !steps.finished() && found.steps < from.iterations &&
         worse < kMostWorseSteps) {
    const int taken = steps.steps(found.steps + 1);
    if (taken == found.steps) break;
    found.steps = taken;
    const FurtherMeans now = steps.means();
    const bool nearer = is_nearer(now, found.best);
    worse = nearer ? 0 : worse + 1;
    if (!nearer) continue;
    found.best = now;
    result.taken = true;
    result.values = steps.values();
  }
  result.evaluations = steps.evaluations();
  return found;
}

Found move_published(ImageSteps& steps, const ImageWeightsStart& from, const PublishedLaw& start,
                     ImageWeights& result) {
  const PublishedFound found = search_published(steps, start, from.values, from.iterations);
  result.evaluations = found.evaluations;
  if (found.taken) {
    result.taken = true;
    result.values = found.values;
    result.published = std::make_shared<material::PublishedWeights>(found.weights);
    steps.begin(material::make_published_law(found.weights, start.name), found.values);
  }
  return {found.steps, found.without, found.best};
}

}  // namespace

ImageWeights fit_image_weights(ImageExperiment& experiment, const ImageWeightsStart& from,
                               std::vector<Json>& history) {
  ImageSteps steps(experiment, from, history);
  const mpm::Scene& scene = experiment.model().scene(0);
  const auto law = scene.bodies[fit::body_index(scene, from.body)].material.published;
  ImageWeights result;
  const Found found =
      law ? move_published(steps, from, *law, result) : move_isotropic(steps, from, result);
  if (!result.taken) steps.leave();
  result.report = {{"body", from.body},
                   {"taken", result.taken},
                   {"iterations", found.steps},
                   {"evaluations", result.evaluations},
                   {"held_out_iou", both_ious(found.without.held, found.best.held)},
                   {"fitted_iou", both_ious(found.without.seen, found.best.seen)}};
  const char* what = law ? "all weights of its nets" : "all weights of its energy";
  if (result.taken) {
    const bool judged = found.without.held.has_value();
    const Json& ious = result.report.at(judged ? "held_out_iou" : "fitted_iou");
    result.statement = fmt::format(
        "{}: with {} moved, the outlines that were {} agree to an IoU of {:.3f} in the mean, "
        "without to {:.3f}.{}",
        from.body, what, judged ? "held out" : "fitted", ious.at("with").get<double>(),
        ious.at("without").get<double>(),
        judged ? " What was held out has chosen among the iterations." : "");
  } else {
    result.statement =
        fmt::format("{}: moving {} predicts no better than without; they stay.", from.body, what);
  }
  return result;
}

std::string body_with_weights(const Job& job, const std::vector<std::string>& bodies) {
  for (const std::string& name : bodies) {
    const material::Law law = body_named(job.scene, name).material.law;
    const bool has = law == material::Law::kPublished || law == material::Law::kNeuralIsotropic;
    if (has) return name;
  }
  return "";
}

void write_image_weights(const ImageWeights& weights, const Job& job, Json& document) {
  const std::string body = weights.report.at("body");
  if (weights.published) {
    write_published_weights(*weights.published, body, job.output.folder, document);
    return;
  }
  ReadOptions read;
  read.base_folder = job.base_folder;
  const Job moved = read_job(document.dump(), read);
  write_weights(body_named(moved.scene, body).material, body, job.output.folder, document);
}

}  // namespace matterfit::job
