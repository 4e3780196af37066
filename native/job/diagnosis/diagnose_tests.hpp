// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "base/interrupter.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {

/// Fits a law to what a testing machine measured (docs/formats.md, `matterfit.tests/1`), then asks
/// what it gets wrong, as run_diagnose() does for recordings. Sizes are shares of a stress. Returns
/// the report; its `model` holds the material and the effects of the accepted causes, as entries of
/// a job's scene. Throws Error of every kind.
[[nodiscard]] Json diagnose_tests(const std::filesystem::path& file, int threads,
                                  Interrupter& interrupter);

}  // namespace matterfit::job
