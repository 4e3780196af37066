// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "job/documents/document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// A document made into what the solver takes.
struct BuiltScene {
  mpm::Scene scene;
  std::vector<std::string> fill_reports;  ///< one a body: what the fill did
  std::vector<std::string> notes;         ///< what may not be as it was meant
};

/// Reads the files that the scene names, fills the bodies, samples keyed quantities to seconds.
/// dx is twice the particle separation. Deterministic. Throws Error(kInput) with the JSON path of
/// the body, pin or collider, Error(kCancelled).
[[nodiscard]] BuiltScene build_scene(const Job& job, Arena& arena, const Interrupter& interrupter);

/// The particles of one body with their lattice, placed in the world.
[[nodiscard]] mpm::Body build_body(const BodyDoc& doc, const SceneDoc& scene,
                                   const std::string& path, std::string& report, Arena& arena,
                                   const Interrupter& interrupter);

/// The region in the solver's words; opens the file of a `points` region.
[[nodiscard]] mpm::Pin pin_region(const Region& region);

/// N × 3 positions of a .npz, .npy (`positions`, of which the first frame counts) or .ply [m].
[[nodiscard]] Points read_points(const std::filesystem::path& path);

}  // namespace matterfit::job
