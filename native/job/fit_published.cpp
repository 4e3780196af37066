// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_published.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "job/fit_published_search.hpp"
#include "job/fit_report.hpp"
#include "job/fit_weights.hpp"
#include "material/neural/published_file.hpp"
#include "material/neural/published_law.hpp"
#include "material/neural/published_material.hpp"

namespace matterfit::job {
namespace {

using material::PublishedLaw;
using material::PublishedWeights;

/// Steps of a fit to tracks.
class TrackSteps final : public PublishedSteps {
 public:
  TrackSteps(const FurtherStart& from, const Interrupter& interrupter,
             std::vector<std::string>& statements, std::vector<Json>& history)
      : from_(from), interrupter_(interrupter), statements_(statements), history_(history) {}

  void begin(std::shared_ptr<const PublishedLaw> law, const std::vector<double>& values) override {
    fit::SearchSetup setup = from_.setup;
    for (fit::SceneBuilder& builder : setup.builders) {
      builder = with_published(std::move(builder), from_.body, law);
    }
    for (fit::ParameterSpec& move : weight_moves_of(from_.body, 0, law->directions.size())) {
      setup.parameters.push_back(std::move(move));
    }
    fit_ = std::make_unique<fit::LawFit>(std::move(setup), interrupter_, statements_);
    fit_->report = from_.tell;
    std::vector<double> all = fit_->start().values;
    std::copy(values.begin(), values.end(), all.begin());
    state_ = fit_->at_last_stage(std::move(all));
  }

  [[nodiscard]] FurtherMeans means() override { return means_of(*fit_, state_); }

  int steps(int most) override {
    while (!state_.finished() && state_.iterations < most) advance(*fit_, state_, history_);
    return state_.iterations;
  }

  [[nodiscard]] const std::vector<double>& values() const override { return state_.values; }

  [[nodiscard]] std::vector<double> slope() override {
    try {
      fit_->compare(state_);
      if (auto slope = fit_->published_slope(state_, from_.body)) return std::move(*slope);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kCompute) throw;
    }
    return {};
  }

  [[nodiscard]] int evaluations() const override { return state_.evaluations; }

  /// The weights of the body that the fit begins with.
  [[nodiscard]] std::shared_ptr<const PublishedLaw> start() const {
    const fit::LawFit as_it_is(from_.setup, interrupter_, statements_);
    const mpm::Scene& scene = as_it_is.scenes().front();
    return scene.bodies[fit::body_index(scene, from_.body)].material.published;
  }

  /// Hands out the fit where it stands.
  void end(FurtherFit& result) {
    if (!state_.values.empty()) fit_->compare(state_);  // for their errors
    result.fit = std::move(fit_);
    result.state = std::move(state_);
  }

 private:
  const FurtherStart& from_;
  const Interrupter& interrupter_;
  std::vector<std::string>& statements_;
  std::vector<Json>& history_;
  std::unique_ptr<fit::LawFit> fit_;
  fit::LawState state_;
};

}  // namespace

FurtherFit fit_published_weights(const FurtherStart& from, const Interrupter& interrupter,
                                 std::vector<std::string>& statements, std::vector<Json>& history) {
  TrackSteps steps(from, interrupter, statements, history);
  const auto start = steps.start();
  const PublishedFound found = search_published(steps, *start, from.before.values, from.iterations);
  FurtherFit result;
  result.key = "weights";
  if (found.taken) {
    steps.begin(material::make_published_law(found.weights, start->name), found.values);
    steps.end(result);
    result.taken = true;
    result.state.iterations = from.before.iterations + found.steps;
    result.state.evaluations = from.before.evaluations + found.evaluations;
    result.state.phase = from.before.phase;
    result.state.statements = from.before.statements;
  }
  result.report = further_report(from.body, found.taken, found.steps, found.evaluations,
                                 found.without, found.best);
  add_weights_statement(from.body, "all weights of its nets", result, statements);
  return result;
}

void write_published_weights(const PublishedWeights& weights, const std::string& body,
                             const std::filesystem::path& folder, Json& document) {
  write_weights_file(material::published_tensors(weights), "neural", body, folder, document);
}

}  // namespace matterfit::job
