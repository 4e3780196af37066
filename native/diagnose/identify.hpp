// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "diagnose/model.hpp"

namespace matterfit::diagnose {

/// How well a recording determines one parameter.
struct Identifiable {
  std::string name;
  std::string unit;
  double value = 0.0;  ///< physical, at the start
  double error = 0.0;  ///< physical, standard, that a fit will have; infinite if not identifiable
  double keep = 0.0;   ///< share of its signature that the others cannot imitate
  bool known = false;  ///< its error is below Parameter::scale
};

/// Parameters of which the recording determines only a combination.
struct Tie {
  std::vector<std::string> names;
  double keep = 0.0;  ///< of the direction: √ of its information over that of its members alone
};

/// Something taken as given that a fit would hide in a parameter.
struct Assumption {
  std::string effect;     ///< an effect that is taken not to be there
  std::string size;       ///< what was tried, "0.02 m"
  std::string parameter;  ///< the parameter that it would move most, in errors
  double shift = 0.0;     ///< physical, by the effect of that size
  double errors = 0.0;    ///< that, over the parameter's error
};

/// How much of what a recording has is needed.
struct Enough {
  std::string what;  ///< "frame rate", "duration", "noise"
  /// Error of the parameter that suffers most with half of the frames, the first half of the time,
  /// or twice the noise, over its error with all.
  double ratio = 1.0;
  std::string parameter;  ///< which that is
  bool enough = true;
  std::string sentence;
};

struct BeforeFit {
  double sigma = 0.0;  ///< noise of a coordinate [m]: stated, else estimated
  double autocorrelation = 0.0;
  std::vector<Identifiable> parameters;
  std::vector<Tie> ties;
  std::vector<Assumption> assumptions;  ///< worst first
  std::vector<Enough> enough;
  std::vector<std::string> statements;  ///< all of it for people, the most important first
  std::string record_instead;           ///< empty: nothing needed, or nothing known that helps
};

struct IdentifyOptions {
  int limit = 12000;  ///< rows
  bool central = true;
  std::function<void(double, const std::string&)> progress;  ///< fraction, what is being done
};

/// Before anything is fitted: the information matrix at the start values from a handful of runs,
/// noise as stated or as the recording shows it beside smooth motion, the solver's error from two
/// resolutions. Says which parameters the recording determines and how well, which are tied,
/// whether frame rate, duration and noise suffice, what an error in what is taken as given would
/// do, and which of Model::experiments() would help. Throws like diagnose().
[[nodiscard]] BeforeFit identify(const Model& model, const IdentifyOptions& options = {});

}  // namespace matterfit::diagnose
