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
  /// Standard deviation of what is read, as a share of the stress and half of its test's mean
  /// together: what a diagnosis takes a test of fewer than thirty readings to err by. A machine of
  /// class 1 (ISO 7500-1) errs by .01.
  double noise = 0.01;
  material::Law law = material::Law::kNeoHookean;  ///< that a diagnosis begins with
  std::vector<material::MachineTest> fitted;
  std::vector<material::MachineTest> held_out;
};

/// Whether a file says of itself that it is one; false where it cannot be read.
[[nodiscard]] bool is_tests_file(const std::filesystem::path& file);

/// The readings of each test come in the order of their stretches. Throws Error(kInput) with the
/// path of what is missing, unknown or of another kind.
[[nodiscard]] TestsDoc read_tests_file(const std::filesystem::path& file);

}  // namespace matterfit::job
