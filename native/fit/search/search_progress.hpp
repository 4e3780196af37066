// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace matterfit::fit {

/// Where a search stands, for progress.
struct SearchProgress {
  std::string stage;      ///< its frames, or what is done beside the stages
  double level = 1.0;     ///< of its particle separation
  double fraction = 0.0;  ///< of this law's fit, a guess
  int iteration = 0;
  double rms = 0.0;  ///< [m]; NaN: not known
};

/// One accepted or refused step of a search, for its history.
struct SearchStep {
  std::string stage;
  std::string law;
  int iteration = 0;
  double cost = 0.0;
  double rms = std::numeric_limits<double>::quiet_NaN();  ///< [m]; NaN: not known
  bool accepted = false;
  int evaluations = 0;         ///< of the law so far
  std::vector<double> values;  ///< physical, one a parameter; empty where none were taken
};

}  // namespace matterfit::fit
