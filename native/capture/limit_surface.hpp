// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "capture/mesh.hpp"

namespace matterfit::capture {

struct LimitOptions {
  int level = 3;  ///< times each face is split, 1 to 10
  /// Corners of open borders stay where they are (Blender: Keep Corners); off: rounded (All).
  bool keep_corners = false;
};

/// Quads whose corners lie exactly on the Catmull–Clark limit surface of `cage` (OpenSubdiv:
/// uniform refinement, then limit masks), creases included; sharpness still left at `level` acts as
/// infinite. Throws Error(kInput) for a cage that OpenSubdiv cannot take (faces or creases that
/// name no vertices, an edge with more than two faces is allowed) and for more than 16 million
/// faces.
[[nodiscard]] Mesh limit_mesh(const Mesh& cage, const LimitOptions& options = {});

}  // namespace matterfit::capture
