// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace matterfit::job {

inline constexpr const char* kCheckpointPath = "state/checkpoint.bin";

/// Where a run stood: the solver's own bytes (mpm::Simulation::save) after a line that says of
/// which inputs and frame they are, and their hash.
struct Checkpoint {
  std::string input_hash;
  int frame = 0;
  std::string bytes;
};

[[nodiscard]] std::string format_checkpoint(const Checkpoint& checkpoint);

/// Nothing if it is missing, truncated, damaged or of other inputs: the run then starts afresh.
[[nodiscard]] std::optional<Checkpoint> read_checkpoint(const std::filesystem::path& folder,
                                                        const std::string& input_hash);

}  // namespace matterfit::job
