// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "job/documents/json_reader.hpp"

/// Stress against stretch of the materials of a file (docs/formats.md, `matterfit curves`).
namespace matterfit::job {

struct CurveOptions {
  /// Largest |dev ε|; without it one and a half times what the material was seen at, else .5.
  std::optional<double> strain;
  /// |dev D| [1/s]; without it the middle of what it was seen at, else 1.
  std::optional<double> rate;
  /// The nearest classical law beside a neural one, and a law alone beside its correction.
  bool beside = true;
};

/// {"strain", "rate", "beside"} as JSON; an unknown key or a value out of range is
/// Error(kInput).
[[nodiscard]] CurveOptions curve_options(const Json& json);

/// For each material, by its name: {"strain", "rate", "excited" or null, "sentence" (of a neural
/// law: what it is like), "distance", "faults", "curves": [{"what": "material" | "nearest" |
/// "alone", "law", "label", "uniaxial": {"stretch", "nominal", "true", "across"}, "equibiaxial":
/// the same, "shear": {"shear", "nominal", "true", "across"}}]}; stresses in Pa. A pull that cannot
/// be followed is null and among the faults. The file is a job document, a material, or weights:
/// *.safetensors of the isotropic law or of the published one, *.pt of that as PyTorch saves it.
/// Throws Error(kInput) where it is none.
[[nodiscard]] Json curves_of_file(const std::filesystem::path& file, const CurveOptions& options);
/// The same of the text of a document or a material whose files lie in `folder`.
[[nodiscard]] Json curves_of_text(std::string_view text, const std::filesystem::path& folder,
                                  const CurveOptions& options);

/// A picture (SVG) of one entry of these: a graph a pull, what the material was seen at shaded.
[[nodiscard]] std::string curves_picture(const std::string& name, const Json& curves);

}  // namespace matterfit::job
