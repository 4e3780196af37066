// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "capture/carried_splats.hpp"
#include "capture/splats.hpp"

namespace matterfit::fit {

/// Splats that a scene's body is drawn by in place of its particles, where it starts. A body may
/// have several.
struct BodySplats {
  std::size_t body = 0;
  capture::Splats splats;
};

/// The same, carried along by the body.
struct OwnSplats {
  std::size_t body = 0;
  capture::CarriedSplats splats;
};

/// `scene`'s bodies are those that the splats start with. Throws as CarriedSplats does.
[[nodiscard]] std::vector<OwnSplats> carried(const std::vector<BodySplats>& all,
                                             const mpm::Scene& scene, Arena& arena,
                                             const Interrupter* interrupter = nullptr);

/// Whether a body, or without one each of the scene's, is drawn by splats of its own.
[[nodiscard]] bool drawn_by_splats(std::span<const OwnSplats> own, std::size_t bodies,
                                   std::optional<std::size_t> body);

}  // namespace matterfit::fit
