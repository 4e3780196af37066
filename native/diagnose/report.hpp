// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/vec.hpp"
#include "diagnose/free_law.hpp"
#include "diagnose/study.hpp"

namespace matterfit::diagnose {

enum class Verdict {
  kNothing,      ///< nothing beyond noise and the solver's own error
  kCause,        ///< one cause
  kClass,        ///< one of several that this recording cannot distinguish
  kSeveral,      ///< several causes act
  kUnknown,      ///< something, but none of the causes known
  kNumerical,    ///< the grid's error, not physics
  kMeasurement,  ///< one cause, or a class, of measurement
};
/// The word of the report: "nothing", "cause", …
[[nodiscard]] const char* name(Verdict verdict);

struct Value {
  std::string name;
  std::string unit;
  double value = 0.0;
  double error = 0.0;  ///< standard, widened by √(χ²/dof)
};

/// A rival, and how like it is.
struct Confusion {
  std::string effect;
  std::string scope;
  double cosine = 0.0;
};

/// One row of the cause table.
struct Cause {
  int effect_index = 0;  ///< into Model::effects()
  int variant = 0;
  std::string effect;
  std::string scope;
  std::string group;
  std::string where;  ///< the variant's description
  double probability = 0.0;
  double score = 0.0;  ///< T at the linearisation
  double p = 1.0;      ///< of such a largest score where nothing is hidden
  double keep = 0.0;   ///< κ
  bool observable = false;
  bool refitted = false;
  bool accepted = false;
  std::vector<Value> parameters;  ///< refitted, else first estimates
  double explained = 0.0;         ///< share of the excess χ² that it takes away
  double holdout_before = 0.0;    ///< [m]
  double holdout_after = 0.0;
  double holdout_floor = 0.0;
  double last_residual = 0.0;  ///< naive baselines on the same samples [m]
  double free_field = 0.0;
  double gain = 0.0;
  double gain_low = 0.0;
  double gain_high = 0.0;
  bool gain_measurable = false;
  /// The share of what it makes that a law of free form could make as well at most; NaN: not known.
  double absorbed = std::numeric_limits<double>::quiet_NaN();
  std::vector<Confusion> confused_with;
  std::vector<double> evidence_by_frame;  ///< T over a sliding window, capture after capture
  std::string evidence;                   ///< a sentence: why it is believed or not
  std::string sentence;                   ///< the effect's own, with values
};

/// The law of free form, looked at last (free_law.hpp), and what it explains.
struct LawRow {
  double score = 0.0;
  double p = 1.0;
  double keep = 0.0;
  bool observable = false;
  bool refitted = false;
  LawTrial::End end = LawTrial::End::kUnlikely;  ///< kImproves: it is in the extended model
  std::vector<Value> parameters;
  double explained = 0.0;  ///< share of the excess χ² that the named causes leave; gain likewise
  double gain = 0.0;
  double gain_low = 0.0;
  double gain_high = 0.0;
  bool gain_measurable = false;
  std::string sentence;
};

struct DetectionLimit {
  std::string effect;
  std::string scope;
  std::string number;
  std::string unit;
  double value = 0.0;
};

struct WorstFrame {
  int capture = 0;
  int frame = 0;                ///< frame number
  Vec3d where = Vec3d::Zero();  ///< measured position of the worst track [m]
  double size = 0.0;            ///< its distance [m]
};

struct FrameError {
  int capture = 0;
  int frame = 0;
  double time = 0.0;
  double rms = 0.0;  ///< over tracks [m]
  /// The same with the extended model; NaN without.
  double after = std::numeric_limits<double>::quiet_NaN();
  double noise = 0.0;      ///< what noise alone makes [m]
  double numerical = 0.0;  ///< what the solver's spread makes [m]
  bool held_out = false;
};

/// A part of the body during a frame in which the simulation is wrong.
struct WrongPlace {
  int capture = 0;
  int frame = 0;
  int region = 0;       ///< of region_names()
  double sigmas = 0.0;  ///< mean residual over its standard deviation
};

struct Sizes {
  double rms = 0.0;
  double p95 = 0.0;
};

struct NoiseSummary {
  double sigma = 0.0;            ///< of a coordinate, all captures [m]
  double autocorrelation = 0.0;  ///< from frame to frame
  double common_sigma = 0.0;     ///< shared by all tracks [m]
  double place_sigma = 0.0;      ///< of where on the body a track is [m]
  double kurtosis = 0.0;
};

struct Report {
  Verdict verdict = Verdict::kNothing;
  std::string headline;  ///< the verdict in a sentence for people
  Shown shown;           ///< of sizes that are said to be in [m] below
  NoiseSummary noise;
  double numerical = 0.0;  ///< the solver's own spread, root mean square [m]
  double bias = 0.0;       ///< the fitted amplitude of the extrapolated grid error; 1: as expected
  Sizes train;
  Sizes holdout;
  std::vector<FrameError> by_frame;
  std::vector<WorstFrame> worst;
  std::vector<WrongPlace> wrong;
  std::vector<std::vector<std::string>> regions;  ///< region_names() of each capture
  /// "class": names that the recording cannot distinguish, or all that act.
  std::vector<std::string> classes;
  std::vector<Cause> causes;  ///< the most probable first, DiagnoseOptions::listed of them
  int tested = 0;             ///< causes in all
  std::optional<LawRow> law;  ///< nothing where the model has none
  std::vector<std::string> not_observable;
  std::vector<DetectionLimit> detection_limits;
  std::string next_recording;
  double threshold = 0.0;       ///< T* at the level
  double p = 1.0;               ///< of the largest score
  double smooth_p = 1.0;        ///< of the smooth residual, before any extension
  double smooth_p_after = 1.0;  ///< after the best extension
  bool remains = false;         ///< the best extension leaves more than noise and solver make
  double explained = 0.0;       ///< share of the smooth excess that the best extension explains
  double probability_nothing = 0.0;
  double probability_unknown = 0.0;
  State extended;    ///< the model to go on with: fitted values, and the causes that act
  int runs = 0;      ///< simulations
  bool cut = false;  ///< searches ended since DiagnoseOptions::most_runs were used up
  bool began_elsewhere = false;  ///< Approach::elsewhere: the fit had gone astray
  std::vector<std::pair<std::string, int>> by_stage;  ///< the same by what they were for
};

/// Sentences for people, one function a verdict, all from the report's numbers.
[[nodiscard]] std::string headline(const Report& report);
/// A sentence for people on what a refitted law explains. `named`: beside causes that are named.
[[nodiscard]] std::string law_sentence(const LawRow& law, bool named);
/// "0.021 ± 0.0006 m²"
[[nodiscard]] std::string with_error(const Value& value);
/// The effect's template with values put in.
[[nodiscard]] std::string fill_sentence(const Effect& effect, const Cause& cause);

}  // namespace matterfit::diagnose
