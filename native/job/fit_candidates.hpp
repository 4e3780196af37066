// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/interrupter.hpp"
#include "fit/search/law_fit.hpp"
#include "job/documents/fit_document.hpp"
#include "job/fit_experiment.hpp"
#include "job/fit_state.hpp"

namespace matterfit::job {

/// Share of the whole that the fit takes; the rest is the fitted scene's simulation.
inline constexpr double kFitShare = 0.9;

/// The candidate laws of a fit, searched side by side (fit/search/race.hpp); where the document
/// names none, the body's own alone. Every step is on disk, as `fit/checkpoint.json` and
/// `fit/history.jsonl` in the job's output folder.
class FitCandidates {
 public:
  /// Builds the scenes and settles the captures. `job`, `interrupter` and `loaded` are borrowed.
  /// `state`: where an earlier run of this fit stopped; one without laws: at the beginning.
  /// `statements` gets what is odd about the captures. Throws Error(kInput), Error(kCancelled).
  FitCandidates(const Job& job, mpm::SimdTarget target, int threads, Interrupter& interrupter,
                LoadedExperiment& loaded, FitState state, std::vector<std::string>& statements);
  FitCandidates(const FitCandidates&) = delete;
  FitCandidates& operator=(const FitCandidates&) = delete;

  /// Until every law is finished, left or failed, and the one that predicts best is finished.
  /// Throws Error of every kind; of several laws one that cannot be fitted is `failed` instead.
  void search();
  /// The law that is taken: the best of all, or the one that came nearest so far.
  [[nodiscard]] std::size_t winner() const;

  [[nodiscard]] FitState& state() { return state_; }
  /// Made along the way; FitState::statements once it is saved.
  [[nodiscard]] std::vector<std::string>& law_statements() { return law_statements_; }
  /// The fit of a law, made where it is not yet.
  [[nodiscard]] fit::LawFit& fit(std::size_t law);
  [[nodiscard]] fit::LawFit& fit(std::size_t law, const Interrupter& interrupter);
  [[nodiscard]] fit::SearchSetup setup_of(material::Law law) const;
  /// Reports the progress of the law that is being fitted. From any thread.
  void show(const fit::SearchProgress& report);
  /// Writes the state to disk.
  void save();

 private:
  /// The body's own law where none is sought.
  fit::LawFit& law_fit(material::Law law, const Interrupter& interrupter);
  /// One step of a law, and the end of those that have no hope after it.
  void advance(fit::LawState& law);
  /// Measures a candidate for the report and releases its scenes, as there may be many.
  void finish_law(std::size_t k);

  const Job& job_;
  const FitDoc& doc_;
  mpm::SimdTarget target_;
  int threads_;
  Interrupter& interrupter_;
  LoadedExperiment& loaded_;
  FitState state_;
  std::vector<std::string> law_statements_;
  material::Law own_law_ = material::Law::kFixedCorotated;
  std::vector<material::Law> laws_;
  /// The fits of the laws that are still searched, and that of the document's law while the start
  /// is looked at.
  std::map<material::Law, std::unique_ptr<fit::LawFit>> fits_;
  std::vector<double> fractions_;  ///< of each law's fit, for progress
  std::mutex fractions_mutex_;
  Clock::time_point started_;
};

}  // namespace matterfit::job
