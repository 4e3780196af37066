// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "base/interrupter.hpp"
#include "fit/search/search_progress.hpp"

namespace matterfit::job {

/// Labels progress with where a fit is; with less room the iteration is left out, then the law.
/// `law` empty: the only one.
void label_fit(const fit::SearchProgress& report, const std::string& law, Progress& progress);

}  // namespace matterfit::job
