// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_progress.hpp"

#include <fmt/format.h>

#include <cmath>

namespace matterfit::job {

void label_fit(const fit::SearchProgress& report, const std::string& law, Progress& progress) {
  const std::string iteration =
      report.iteration > 0 ? ", iteration " + std::to_string(report.iteration) : "";
  const std::string rms =
      std::isfinite(report.rms) ? fmt::format(", rms {:.2f} mm", 1e3 * report.rms) : "";
  std::string stage = report.stage;
  if (report.level != 1.0) stage += fmt::format(" ×{:g}", report.level);
  const std::string name = law.empty() ? "" : law + ", ";
  progress.label = "Fitting: " + name + stage + iteration + rms;
  progress.shorter = {"Fitting: " + name + stage + rms, "Fitting: " + stage + rms};
}

}  // namespace matterfit::job
