// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "material/excitation.hpp"
#include "material/material.hpp"

namespace matterfit::job {

struct NamedMaterial {
  std::string name;  ///< the body's; of a material alone the file's, without its ending
  material::Material material;
  std::optional<material::Excitation> excited;  ///< what it was seen at, where the file says so
};

/// The materials of a file: of every body of a job document, or that of a material as a fit or the
/// panel writes it (`matterfit.material/1`). Throws Error(kInput) where the file is neither.
[[nodiscard]] std::vector<NamedMaterial> materials_of_file(const std::filesystem::path& file);
/// The same of the text of such a file; `name` stands in messages, relative paths begin at
/// `folder`. A material alone is called by `alone`.
[[nodiscard]] std::vector<NamedMaterial> materials_of_text(std::string_view text,
                                                           const std::filesystem::path& folder,
                                                           const std::string& name,
                                                           const std::string& alone);

}  // namespace matterfit::job
