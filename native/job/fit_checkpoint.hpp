// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "job/documents/json_reader.hpp"

/// The file that an unfinished fit leaves, of whatever kind: schema, input hash, state and a hash
/// of that.
namespace matterfit::job {

inline constexpr const char* kFitCheckpointPath = "fit/checkpoint.json";

/// Numbers to the last bit: equal states give equal texts.
[[nodiscard]] std::string format_checkpoint(const char* schema, const std::string& input_hash,
                                            const Json& state);

/// The whole file; null where it is missing, discarded where it is no JSON.
[[nodiscard]] Json read_checkpoint(const std::filesystem::path& folder);

/// Whether such a file is of this schema and undamaged. Throws Json::exception where a part is
/// missing.
[[nodiscard]] bool is_checkpoint_of(const Json& file, const char* schema);

}  // namespace matterfit::job
