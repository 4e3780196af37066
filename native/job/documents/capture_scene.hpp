// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "job/documents/document.hpp"

/// Captures with a scene of their own (`captures[].scene`): another throw, another mass, other
/// frames.
namespace matterfit::job {

/// `overrides` laid over `scene`: objects merge, lists of named things (bodies, colliders) merge by
/// name, null removes, any other value replaces. An entry whose name is new is added. Throws
/// Error(kInput) beginning with `path` for an entry of such a list that has no name.
[[nodiscard]] Json merged_scene(const Json& scene, const Json& overrides, const std::string& path);

/// Captures that are simulated together.
struct SceneGroup {
  std::vector<std::size_t> captures;  ///< indices into the job's
  bool own = false;                   ///< of a scene of their own; else the document's
  std::string name;                   ///< of its first capture, for a folder; empty for the first
};

/// The document's scene first (with the captures that have no other, perhaps none), then one group
/// for each different scene, in the order of the captures.
[[nodiscard]] std::vector<SceneGroup> scene_groups(const Job& job);

/// A job of one group alone: its captures, their scene in place of the document's. The output
/// folder of a scene of its own is `runs/NAME` in the job's, with states and comparisons only.
[[nodiscard]] Job group_job(const Job& job, const SceneGroup& group);

}  // namespace matterfit::job
