// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_progress.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>

namespace matterfit::job {

std::string fit_label(const fit::SearchProgress& report, const std::string& law) {
  constexpr std::size_t kMost = 63;  // matterfit.h, mf_progress.label, without its end
  const std::string iteration =
      report.iteration > 0 ? ", iteration " + std::to_string(report.iteration) : "";
  const std::string rms =
      std::isfinite(report.rms) ? fmt::format(", rms {:.2f} mm", 1e3 * report.rms) : "";
  std::string stage = report.stage;
  if (report.level != 1.0) stage += fmt::format(" ×{:g}", report.level);
  const std::string name = law.empty() ? "" : law + ", ";
  std::string label = "Fitting: " + name + stage + iteration + rms;
  if (label.size() > kMost) label = "Fitting: " + name + stage + rms;
  if (label.size() > kMost) label = "Fitting: " + stage + rms;
  return label;
}

}  // namespace matterfit::job
