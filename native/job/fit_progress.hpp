// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "fit/search/search_progress.hpp"

namespace matterfit::job {

/// As a label of progress, of 63 bytes at most (capi/matterfit.h): where that is too little the
/// iteration is left out, then the law. `law` empty: the only one.
[[nodiscard]] std::string fit_label(const fit::SearchProgress& report, const std::string& law);

}  // namespace matterfit::job
