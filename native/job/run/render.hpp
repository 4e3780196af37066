// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/interrupter.hpp"
#include "job/documents/document.hpp"
#include "job/run/run_options.hpp"

namespace matterfit::job {

/// Draws the scene frame by frame through the cameras of the section `render`, simulating what the
/// output folder does not hold yet: `render/camera_0/0001.png`, … Bodies that have splats in
/// `output.splats`, or were filled of some, are drawn by them, others by their particles, and all
/// antialiased where one of these files was trained so. With `render.gaussians` that file
/// alone is drawn, once a camera: `render/camera_0.png`. Throws Error of every kind.
[[nodiscard]] Json run_render(const Job& job, const RunOptions& options, Interrupter& interrupter);

}  // namespace matterfit::job
