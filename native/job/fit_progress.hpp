// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace matterfit::job {

/// Where a search stands, for progress.
struct FitReport {
  std::string stage;
  double fraction = 0.0;  ///< of this law's fit, a guess
  int iteration = 0;
  double rms = 0.0;  ///< [m]; NaN: not known
};

/// As a label of progress, of 63 bytes at most (capi/matterfit.h): where that is too little the
/// iteration is left out, then the law. `law` empty: the only one.
[[nodiscard]] std::string fit_label(const FitReport& report, const std::string& law);

}  // namespace matterfit::job
