// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "material/neural/isotropic_material.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/published_material.hpp"

/// Weights of neural laws: the shipped start laws, which the library carries
/// (presets/neural/*.safetensors, compiled in), and files.
namespace matterfit::job {

/// Where a document names none.
inline constexpr const char* kDefaultNeuralStart = "jelly";

/// The shipped decoder of the latent law, of presets/neural/latent.safetensors.
[[nodiscard]] std::shared_ptr<const material::LatentDecoder> latent_preset();
/// The latent law's decoder in a file. Throws Error(kInput) that names the file and what is wrong
/// with it.
[[nodiscard]] std::shared_ptr<const material::LatentDecoder> read_latent_file(
    const std::filesystem::path& path);
inline constexpr const char* kLatentName = "latent";

/// A shipped one. Throws Error(kInput) that lists their names. Each is read once a process.
[[nodiscard]] std::shared_ptr<const material::IsotropicStart> neural_start(const std::string& name);

/// Whether `weights` of a document are a file rather than a name: *.safetensors, and *.pt of the
/// published law as PyTorch saves it.
[[nodiscard]] bool is_weights_file(std::string_view text);
/// Throws Error(kInput) that names the file and what is wrong with it.
[[nodiscard]] std::shared_ptr<const material::IsotropicStart> read_weights_file(
    const std::filesystem::path& path);

/// A shipped one of the published law, of presets/neural/published_NAME.safetensors. Throws
/// Error(kInput) that lists their names. Each is read once a process.
[[nodiscard]] std::shared_ptr<const material::PublishedLaw> published_start(
    const std::string& name);
/// What their files' names begin with.
inline constexpr std::string_view kPublishedPrefix = "published_";

/// Weights of the published law, of either kind. Throws Error(kInput) that names the file and what
/// is wrong with it.
[[nodiscard]] std::shared_ptr<const material::PublishedLaw> read_published_file(
    const std::filesystem::path& path);

}  // namespace matterfit::job
