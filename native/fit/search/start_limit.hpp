// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "fit/model/experiment.hpp"
#include "fit/model/parameters.hpp"

namespace matterfit::fit {

/// How stiff a start of a fit may be. What flows, or hardly deforms, looks the same at any
/// stiffness above some, and a simulation takes the longer the stiffer it is: a scan that follows
/// the last hundredths of a misfit ends at runs of many minutes. A body may take 300 substeps
/// a frame, or ten times as many as with the document's start, whichever is more.
class StartLimit {
 public:
  /// `scenes` one a run; only runs that are fitted count.
  StartLimit(const std::vector<Run>& runs, const std::vector<mpm::Scene>& scenes,
             const Parameters& parameters);

  /// Whether a scan may try these values.
  [[nodiscard]] bool allows(std::span<const double> values) const;
  /// With softer bodies where these take more: Young's, bulk and Maxwell's moduli that are fitted,
  /// within their bounds.
  [[nodiscard]] std::vector<double> softened(std::vector<double> values) const;

 private:
  struct Entry {
    std::size_t run = 0;
    std::string body;
    double most = 0.0;  ///< substeps a frame
  };
  [[nodiscard]] double substeps(std::span<const double> values, const Entry& entry) const;

  const Parameters& parameters_;
  std::vector<mpm::Scene> scenes_;  ///< without particles
  std::vector<Entry> entries_;      ///< bodies whose material is moved
};

}  // namespace matterfit::fit
