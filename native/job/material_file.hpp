// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "material/material.hpp"

namespace matterfit::job {

struct NamedMaterial {
  std::string name;  ///< the body's; of a material alone the file's, without its ending
  material::Material material;
};

/// The materials of a file: of every body of a job document, or that of a material as a fit or the
/// panel writes it (`matterfit.material/1`). Throws Error(kInput) where the file is neither.
[[nodiscard]] std::vector<NamedMaterial> materials_of_file(const std::filesystem::path& file);

}  // namespace matterfit::job
