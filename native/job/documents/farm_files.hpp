// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "job/documents/wedge.hpp"

namespace matterfit::job {

/// What hands a wedge to a render farm.
enum class Farm { kSlurm, kFlamenco };

/// Throws Error(kInput) that lists the names.
[[nodiscard]] Farm farm_from_name(const std::string& name);

/// Writes into the wedge's folder what a farm takes, and returns the paths.
///
/// kSlurm: `slurm.sh`, an array job with a task a member, for `sbatch slurm.sh`; `bash slurm.sh 3`
/// runs the fourth member alone. kFlamenco: `flamenco.json`, the body of a request to Flamenco 3's
/// POST /api/v3/jobs, and `matterfit_wedge.js`, the job type that it names, for the Manager's
/// folder `scripts`. `tool` is the matterfit program as the farm's machines see it; there the
/// variable MATTERFIT overrides it in Slurm's script. Throws Error(kOutput).
[[nodiscard]] std::vector<std::filesystem::path> write_farm_files(const WedgeFolder& wedge,
                                                                  Farm farm,
                                                                  const std::string& tool);

}  // namespace matterfit::job
