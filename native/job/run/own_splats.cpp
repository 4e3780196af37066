// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/own_splats.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "capture/carried_splats.hpp"

namespace matterfit::job {

namespace {

capture::Splats placed(const std::filesystem::path& file,
                       const std::optional<Eigen::AlignedBox3d>& crop, double opacity_threshold,
                       const Placement& placement) {
  return capture::placed(capture::chosen(capture::read_splats(file), crop, opacity_threshold),
                         placement.position, placement.rotation, placement.scale);
}

}  // namespace

capture::Splats placed_splats(const SplatOutput& splats, const Placement& placement) {
  return placed(splats.file, splats.crop, splats.opacity_threshold, placement);
}

std::vector<fit::BodySplats> own_splats(const Job& job) {
  std::vector<fit::BodySplats> all;
  const auto add = [&](std::size_t body, const std::string& path, const auto& splats_of) {
    try {
      all.push_back({body, splats_of(job.scene.bodies[body].placement)});
    } catch (const Error& error) {
      throw Error(error.kind(), path + ": " + error.what());
    }
  };
  for (std::size_t b = 0; b < job.scene.bodies.size(); ++b) {
    const BodyDoc& body = job.scene.bodies[b];
    const std::size_t before = all.size();
    for (std::size_t i = 0; i < job.output.splats.size(); ++i) {
      const SplatOutput& splats = job.output.splats[i];
      if (splats.body != body.name) continue;
      add(b, "output.splats[" + std::to_string(i) + "]",
          [&](const Placement& placement) { return placed_splats(splats, placement); });
    }
    if (all.size() > before || body.source.kind != Source::Kind::kGaussians) continue;
    add(b, "scene.bodies[" + std::to_string(b) + "].source", [&](const Placement& placement) {
      return placed(body.source.file, body.source.crop, body.source.opacity_threshold, placement);
    });
  }
  return all;
}

}  // namespace matterfit::job
