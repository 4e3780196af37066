// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "job/documents/safetensors.hpp"
#include "job/fit_further.hpp"

namespace matterfit::job {

/// Goes on (job/fit_further.hpp) with a body's 29 weights (all but the scale, which E is), each
/// with a prior of its row about the start law.
[[nodiscard]] FurtherFit fit_weights(FurtherStart from, const Interrupter& interrupter,
                                     std::vector<std::string>& statements,
                                     std::vector<Json>& history);

/// The builder's scenes with weights of a body's isotropic neural law that can be moved.
[[nodiscard]] fit::SceneBuilder with_weight_moves(fit::SceneBuilder build, std::string body);

/// Says of a further fit with `what` moved whether that predicts better.
void add_weights_statement(const std::string& body, const char* what, const FurtherFit& result,
                           std::vector<std::string>& statements);

/// Said where a fit's document asks for weights and no fitted body has such a law.
inline constexpr const char* kNoWeights =
    "fit.weights: no fitted body is of the law neural_isotropic or neural, so no weights were "
    "moved.";

/// The name of the file in a fit's folder that holds a body's weights.
[[nodiscard]] std::string weights_file_name(const std::string& body);

/// A body's weight_moves from `first` to `end`, as parameters of a further fit.
[[nodiscard]] std::vector<fit::ParameterSpec> weight_moves_of(const std::string& body,
                                                              std::size_t first, std::size_t end);

/// Writes fitted weights of a law to that file of the folder and has the body of `document` name
/// it; gives the body's material there.
Json& write_weights_file(Tensors weights, const char* law, const std::string& body,
                         const std::filesystem::path& folder, Json& document);

/// Writes a fitted material's weights, its weight_moves in them, to that file of the folder, and
/// has the body of `document` name it in place of the moves.
void write_weights(const material::Material& fitted, const std::string& body,
                   const std::filesystem::path& folder, Json& document);

}  // namespace matterfit::job
