// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "job/documents/document.hpp"
#include "job/fit_files.hpp"

namespace matterfit::job {

/// The document that a diagnosis begins with: what was fitted, as a job whose parameters start
/// there, with the bounds and the priors that the fit had. A number of a material that the
/// recording does not identify begins where the fit began, about which its bounds are narrower:
/// there the search has followed what it could not explain, to an end at which nothing moves or no
/// step is small enough. `job` is the one that was fitted; `statements` gets a sentence for each
/// such number.
[[nodiscard]] Json document_to_diagnose(const Job& job, const Fitted& fitted,
                                        std::vector<std::string>& statements);

}  // namespace matterfit::job
