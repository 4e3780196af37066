// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "job/documents/json_reader.hpp"
#include "job/fit_further.hpp"
#include "material/neural/published_weights.hpp"

namespace matterfit::job {

/// Goes on from where a fit ended with all weights of the published law of `from.body`, beside the
/// parameters (job/fit_published_search.hpp). Steps that cannot be simulated are refused. `taken`,
/// the best iterate and `report` as of go_on(); `key` is "weights". The result's fit has the
/// parameters alone, and scenes with the weights.
[[nodiscard]] FurtherFit fit_published_weights(const FurtherStart& from,
                                               const Interrupter& interrupter,
                                               std::vector<std::string>& statements,
                                               std::vector<Json>& history);

/// Writes them to weights_file_name() of the folder, and the file into the document.
void write_published_weights(const material::PublishedWeights& weights, const std::string& body,
                             const std::filesystem::path& folder, Json& document);

}  // namespace matterfit::job
