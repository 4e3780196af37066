// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "material/neural/machine_tests.hpp"

/// What a testing machine measured of a rubber, as a file (docs/formats.md, `matterfit.tests/1`).
namespace matterfit::job {

struct TestsDoc {
  std::string name;
  std::string source;
  double poisson_ratio = 0.4995;
  std::vector<material::MachineTest> fitted;
  std::vector<material::MachineTest> held_out;
};

/// Throws Error(kInput) with the path of what is missing, unknown or of another kind.
[[nodiscard]] TestsDoc read_tests_file(const std::filesystem::path& file);

}  // namespace matterfit::job
