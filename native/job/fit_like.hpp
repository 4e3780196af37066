// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/parallel.hpp"
#include "fit/model/experiment.hpp"
#include "job/documents/document.hpp"
#include "material/neural/likeness.hpp"

/// What a material of the isotropic neural law is like (docs/formats.md, `like`).
namespace matterfit::job {

/// {"law", "parameters", "distance", "flow_distance", "sentence", "over", "others"}: the nearest
/// classical law (material/neural/likeness.hpp). Throws as likenesses().
[[nodiscard]] Json like_json(const material::Material& neural, const material::Excitation& over);

/// Takes the other's strains and rates in.
void widen(material::Excitation& all, const material::Excitation& by);

/// What the captures of a body that the fit sees excite (fit/data/excitation.hpp), of several the
/// most; nothing where their tracks do not show it. `flows`: its neighbourhoods change.
[[nodiscard]] std::optional<material::Excitation> excitation_of(
    const std::vector<fit::Run>& runs, const std::vector<mpm::Scene>& scenes,
    const std::string& body, bool flows, Arena& arena);

/// Adds to the object `fit` of a result what those of the bodies that are of the neural law are
/// like, by their names, and a statement of each.
void add_likes(const Job& fitted, const std::vector<std::string>& bodies,
               const std::vector<fit::Run>& runs, const std::vector<mpm::Scene>& scenes,
               int threads, Json& fit);

/// The likeness of every body of the neural law in a file: a job document, or a material as a fit
/// writes it.
/// Throws Error(kInput) where the file is neither, or no body is of that law.
[[nodiscard]] Json likes_of_file(const std::filesystem::path& file,
                                 const material::Excitation& over);

}  // namespace matterfit::job
