// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fit/data/capture.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {

/// Throws Error(kInput) for a task that finds none of the captures that it looks at.
void check_captures(const Job& job);
/// The same for what looks at captures by tracks.
void require_tracks(const Job& job);

/// Reads, aligns and times a capture of a job whose captures share its scene
/// (job/documents/capture_scene.hpp takes others apart). `clouds`: capture::TracksOptions::clouds.
/// Throws Error(kInput) beginning with the capture's path.
[[nodiscard]] fit::CaptureInput load_capture(const Job& job, std::size_t index,
                                             bool clouds = false);

/// When the body is let go: the last release of its pins [s], if any is released in the scene.
[[nodiscard]] std::optional<double> body_release(const BodyDoc& body, const SceneDoc& scene);

}  // namespace matterfit::job
