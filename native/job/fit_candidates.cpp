// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_candidates.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/parallel.hpp"
#include "fit/search/race.hpp"
#include "job/fit_files.hpp"
#include "job/fit_laws.hpp"
#include "job/fit_progress.hpp"
#include "job/fit_report.hpp"
#include "job/run/stage.hpp"

namespace matterfit::job {
namespace {

/// A candidate's entry of `models`.
Json measured(fit::LawState& law, fit::LawFit& fit) {
  std::string failure;
  const auto errors = errors_of(fit, law, true, failure);
  if (!errors) {
    law.failed = "The fitted scene could not be simulated: " + failure;
    return {};
  }
  Json parameters = Json::object();
  for (std::size_t k = 0; k < law.values.size(); ++k) {
    parameters[fit.parameters().parameters()[k].name] = law.values[k];
  }
  const auto held = errors->mean(true);
  const auto seen = errors->mean(false);
  return {{"held_out_mm", held ? Json(*held) : Json()},
          {"fitted_mm", seen ? Json(*seen) : Json()},
          {"frames", errors->frames(held.has_value())},
          {"parameters", parameters}};
}

}  // namespace

FitCandidates::FitCandidates(const Job& job, mpm::SimdTarget target, int threads,
                             Interrupter& interrupter, LoadedExperiment& loaded, FitState state,
                             std::vector<std::string>& statements)
    : job_(job),
      doc_(fit_of(job)),
      target_(target),
      threads_(threads),
      interrupter_(interrupter),
      loaded_(loaded),
      state_(std::move(state)),
      law_statements_(state_.statements) {
  const std::string& body = doc_.laws.empty() ? job_.scene.bodies.front().name : doc_.body;
  own_law_ = body_named(job_.scene, body).material.law;
  laws_ = doc_.laws.empty() ? std::vector<material::Law>{own_law_} : doc_.laws;
  fractions_.assign(laws_.size(), 0.0);
  enter_stage(interrupter_, "Filling bodies", 0.0);
  const fit::LawFit& own = law_fit(own_law_, interrupter_);
  Arena arena(threads_);
  settle_captures(loaded_.experiment, own.scenes(), arena, statements);
  if (state_.laws.empty()) {
    for (const material::Law law : laws_) {
      fit::LawState state;
      state.law = material::traits(law).name;
      state_.laws.push_back(std::move(state));
    }
  }
  state_.models.resize(state_.laws.size());
  started_ = Clock::now();
}

fit::LawFit& FitCandidates::fit(std::size_t law) { return law_fit(laws_[law], interrupter_); }

fit::LawFit& FitCandidates::fit(std::size_t law, const Interrupter& interrupter) {
  return law_fit(laws_[law], interrupter);
}

fit::LawFit& FitCandidates::law_fit(material::Law law, const Interrupter& interrupter) {
  std::unique_ptr<fit::LawFit>& made = fits_[law];
  if (made) return *made;
  made = std::make_unique<fit::LawFit>(setup_of(law), interrupter, law_statements_);
  made->report = [this](const fit::SearchProgress& report) { show(report); };
  return *made;
}

fit::SearchSetup FitCandidates::setup_of(material::Law law) const {
  fit::SearchSetup setup;
  setup.options = doc_;
  setup.experiment = &loaded_.experiment;
  setup.law = law;
  setup.target = target_;
  setup.threads = threads_;
  setup.parameters = doc_.laws.empty() ? doc_.parameters : parameters_of_law(doc_, own_law_, law);
  for (const RunSource& source : loaded_.sources) {
    Job of_law = source.job;
    for (BodyDoc& body : of_law.scene.bodies) {
      if (!doc_.laws.empty() && body.name == doc_.body) {
        body.material = with_law(body.material, law);
      }
    }
    setup.builders.push_back(scene_builder(std::move(of_law)));
  }
  setup.memory_limit_gb = loaded_.sources.front().job.scene.solver.memory_limit_gb;
  return setup;
}

void FitCandidates::show(const fit::SearchProgress& report) {
  Progress progress;
  const bool several = laws_.size() > 1 && state_.law < laws_.size();
  {
    const std::lock_guard lock(fractions_mutex_);  // simulations tell from any thread
    if (state_.law < laws_.size()) fractions_[state_.law] = report.fraction;
    double done = 0.0;
    for (std::size_t k = 0; k < laws_.size(); ++k) {
      done += state_.laws[k].finished() ? 1.0 : fractions_[k];
    }
    progress.fraction = kFitShare * done / double(laws_.size());
  }
  label_fit(report, several ? std::string(material::traits(laws_[state_.law]).name) : "", progress);
  interrupter_.report(progress);
}

void FitCandidates::save() {
  const double since = seconds_since(started_);
  started_ = Clock::now();
  state_.seconds += since;
  state_.statements = law_statements_;
  write_history(job_.output.folder, state_.history);
  write_file(job_.output.folder / kFitCheckpointPath, format_fit_state(state_));
}

void FitCandidates::search() {
  if (!state_.measured_before) {
    fit::LawFit& own = law_fit(own_law_, interrupter_);
    if (const auto errors = errors_of(own, own.start(), false, state_.before_failed)) {
      state_.before = errors->json();
    }
    state_.measured_before = true;
    save();
  }
  if (std::find(laws_.begin(), laws_.end(), own_law_) == laws_.end()) fits_.erase(own_law_);
  for (;;) {
    const auto next = fit::next_law(state_.laws);
    if (!next) {
      fit::LawState& best = state_.laws[winner()];
      if (!best.left()) break;
      fit::spare(best);
      continue;
    }
    state_.law = *next;
    fit::LawState& law = state_.laws[*next];
    try {
      advance(law);
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kCancelled || error.kind() == ErrorKind::kOutput ||
          doc_.laws.empty()) {
        throw;
      }
      law.failed = error.what();
      law.phase = fit::Finished{};
      law.search.reset();
      fits_.erase(laws_[*next]);
      save();
    }
  }
}

void FitCandidates::advance(fit::LawState& law) {
  fit::LawFit& fit = this->fit(state_.law);
  if (law.values.empty()) law = fit.start();
  job::advance(fit, law, state_.history);
  if (law.finished()) finish_law(state_.law);
  for (const fit::LeftLaw& left : fit::hopeless_laws(state_.laws)) {
    fit::leave(state_.laws[left.law], left.reason);
    finish_law(left.law);
  }
  save();
}

void FitCandidates::finish_law(std::size_t k) {
  if (doc_.laws.empty()) return;
  state_.law = k;
  fit::LawState& law = state_.laws[k];
  try {
    state_.models[k] = measured(law, fit(k));
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kCompute && error.kind() != ErrorKind::kInput) throw;
    law.failed = error.what();
  }
  if (laws_.size() > 1) fits_.erase(laws_[k]);
}

std::size_t FitCandidates::winner() const {
  if (laws_.size() > 1 && !fit::next_law(state_.laws)) {
    const Json models = ranked_models(state_.laws, state_.models);
    if (models[0].at("probability").is_number()) {
      for (std::size_t k = 0; k < state_.laws.size(); ++k) {
        if (models[0].at("law") == state_.laws[k].law) return k;
      }
    }
  }
  return fit::leading_law(state_.laws).value_or(std::min(state_.law, laws_.size() - 1));
}

}  // namespace matterfit::job
