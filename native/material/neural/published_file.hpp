// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "base/tensors.hpp"
#include "material/neural/published_weights.hpp"

namespace matterfit::material {

/// Reads the published law's weights as PyTorch saves them: a zip archive whose entries
/// NAME/data/0 … 5 are the little-endian float32 matrices 64×13, 64×64 and 9×64 of the elastic net,
/// then of the plastic one. Nothing else in the archive is looked at; in particular its pickle is
/// never run. `name` stands in messages. Throws Error(kInput).
[[nodiscard]] PublishedWeights parse_published_pt(std::span<const std::byte> bytes,
                                                  const std::string& name);
[[nodiscard]] PublishedWeights read_published_pt(const std::filesystem::path& path);

/// The weights as a material file holds them: elastic.0 … 2 and plastic.0 … 2, shape (out, in).
[[nodiscard]] Tensors published_tensors(const PublishedWeights& weights);
/// The opposite; other tensors are not looked at. Throws Error(kInput).
[[nodiscard]] PublishedWeights published_weights(const Tensors& tensors, const std::string& name);

}  // namespace matterfit::material
