// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "base/tensors.hpp"

namespace matterfit::job {

/// A safetensors file (huggingface/safetensors, format of 2022): 8 bytes little-endian length of a
/// JSON header, the header, the tensors' bytes in C order. Ours are float32 ("F32"), sorted by
/// name, each starting at a multiple of 8 bytes, so equal content gives equal bytes.
using matterfit::Tensor;
using matterfit::Tensors;

/// Throws Error(kInput) if a tensor's size is not the product of its shape.
[[nodiscard]] std::string format_safetensors(const Tensors& tensors);

/// Reads float32 tensors; other types are refused. `name` stands in messages. Sizes are checked
/// against the bytes that are there before memory is allocated. Throws Error(kInput).
[[nodiscard]] Tensors parse_safetensors(std::span<const std::byte> bytes, const std::string& name);

}  // namespace matterfit::job
