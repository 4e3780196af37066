// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/predictor.hpp"

#include <utility>

#include "base/error.hpp"
#include "base/parallel.hpp"

namespace matterfit::fit {

Predictor::Predictor(const Experiment& experiment, const std::vector<ParameterSpec>& specs,
                     const Model::Options& options, const Interrupter& interrupter,
                     std::vector<SceneBuilder> builders)
    : experiment_(experiment),
      options_(options),
      interrupter_(interrupter),
      builders_(std::move(builders)) {
  if (builders_.empty()) {
    for (const Run& run : experiment_.runs) builders_.push_back(run.build);
  }
  Arena arena(options_.threads);
  scenes_.reserve(builders_.size());
  for (const SceneBuilder& build : builders_) {
    scenes_.push_back(build(1.0, arena, interrupter_));
  }
  parameters_ = std::make_unique<Parameters>(specs, experiment_.runs, scenes_);
}

const Model& Predictor::model(double level) {
  if (!(level >= 1.0)) {
    throw_input("a level of " + std::to_string(level) +
                " is finer than the scene's particle separation, which is level 1: lower "
                "scene.particle_separation.");
  }
  std::unique_ptr<Model>& model = models_[level];
  if (model) return *model;
  std::vector<mpm::Scene> scenes;
  if (level == 1.0) {
    scenes = scenes_;
  } else {
    Arena arena(options_.threads);
    scenes.reserve(builders_.size());
    for (const SceneBuilder& build : builders_) {
      scenes.push_back(build(level, arena, interrupter_));
    }
  }
  model = std::make_unique<Model>(experiment_.runs, std::move(scenes), *parameters_, options_,
                                  interrupter_);
  return *model;
}

Evaluation Predictor::predict(const std::vector<Ask>& asks, bool velocities,
                              const std::function<void(double)>& progress) {
  std::map<double, std::vector<std::size_t>> by_level;
  for (std::size_t i = 0; i < asks.size(); ++i) by_level[asks[i].level].push_back(i);
  Scope scope = whole_scope(experiment_.runs);
  scope.velocities = velocities;
  Evaluation all;
  all.outcomes.resize(asks.size());
  double done = 0.0;
  for (const auto& [level, places] : by_level) {
    std::vector<Query> queries;
    queries.reserve(places.size());
    for (const std::size_t i : places) queries.push_back(asks[i].query);
    const double share = double(places.size()) / double(asks.size());
    const auto tell = [&](double part) { progress(done + share * part); };
    Evaluation one = model(level).evaluate(queries, scope,
                                           progress ? std::function<void(double)>(tell) : nullptr);
    done += share;
    if (!one.failure.message.empty()) all.failure = std::move(one.failure);
    for (std::size_t k = 0; k < places.size(); ++k) {
      all.outcomes[places[k]] = std::move(one.outcomes[k]);
    }
  }
  return all;
}

}  // namespace matterfit::fit
