// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "job/documents/json_reader.hpp"

namespace matterfit::job {

struct PretrainOptions {
  std::filesystem::path folder;
  std::vector<std::string> laws;  ///< start laws; empty: all, where there are no materials
  /// Files of classical materials (job/material_file.hpp) that the law is regressed to too.
  std::vector<std::filesystem::path> materials;
  /// Files of tests of a rubber (job/documents/tests_document.hpp) that it is regressed to.
  std::vector<std::filesystem::path> tests;
  /// The published law's two nets (material/neural/pretrain_published.hpp) in place of the
  /// isotropic law's weights; its files are published_NAME.safetensors.
  bool published = false;
  bool latent = false;  ///< the latent law's decoder; alone where nothing else is named
  /// All that the library carries: the start laws of both kinds, and the decoder.
  bool all = false;
  int threads = 0;  ///< files are made side by side on them; below 1: as many as the machine has
  std::uint64_t seed = 1;
};

/// Regresses the isotropic neural law to each start law, and to each material
/// (material/neural/pretrain.hpp), writes LAW.safetensors, or one of the material's name, with its
/// provenance (law, seed, accuracy, version) into the folder, and gives the accuracy of each; of
/// a file of tests R² of each test, fitted and held out, beside that of the neo-Hookean nearest to
/// the fitted ones. The latent law's decoder (material/neural/pretrain_latent.hpp) goes into
/// latent.safetensors. Of several files each has `seconds` beside its accuracy.
/// Deterministic in the seed. Throws Error(kInput) for an unknown law, and for `all` with another
/// choice.
[[nodiscard]] Json write_start_laws(const PretrainOptions& options);

}  // namespace matterfit::job
