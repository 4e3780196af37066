// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "job/documents/fit_path.hpp"
#include "material/material.hpp"

namespace matterfit::job {

/// An entry of `fit.parameters`.
struct FitParameterDoc {
  struct Prior {
    std::vector<double> mean;  ///< physical, one a component
    double sigma = 1.0;        ///< physical for linear coordinates, else relative
  };
  std::string where;  ///< "fit.parameters[0]"
  FitPath path;
  std::vector<double> start;                    ///< one a component; empty: the document's value
  std::optional<std::array<double, 2>> bounds;  ///< physical
  std::optional<Prior> prior;
};

/// The section `fit` of a job (docs/formats.md).
struct FitDoc {
  enum class Loss { kTracks, kChamfer, kSurface };
  std::vector<FitParameterDoc> parameters;
  std::vector<material::Law> laws;  ///< candidates; empty: the document's own law
  std::string body;                 ///< whose law is sought, with `laws`
  Loss loss = Loss::kTracks;
  double huber = 0.0;   ///< [standard deviations]; 0: off
  int iterations = 30;  ///< at most, a stage
  bool windows = true;
  /// Particle separations as multiples of the scene's, coarse first; empty: as many as pay.
  std::vector<double> levels;
};

/// As in a document.
[[nodiscard]] std::string_view loss_name(FitDoc::Loss loss);

}  // namespace matterfit::job
