// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>

#include "base/interrupter.hpp"

namespace matterfit::capi {

/// The longest wording of `progress` that takes no more than `most` bytes; where none is as short
/// the shortest wording, cut between two characters of UTF-8.
[[nodiscard]] std::string label_within(const Progress& progress, std::size_t most);

}  // namespace matterfit::capi
