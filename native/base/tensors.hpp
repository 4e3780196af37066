// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace matterfit {

/// Named arrays of float32 in C order with what is said about them: what a file of weights or a
/// state holds, whatever its container (job/documents/safetensors.hpp).
struct Tensor {
  std::vector<std::size_t> shape;
  std::vector<float> values;
};

struct Tensors {
  std::map<std::string, Tensor> tensors;
  std::map<std::string, std::string> metadata;
};

}  // namespace matterfit
