// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/own_splats.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "capture/carried_splats.hpp"

namespace matterfit::job {

capture::Splats placed_splats(const std::filesystem::path& file,
                              const std::optional<Eigen::AlignedBox3d>& crop,
                              const Placement& placement) {
  capture::Splats splats = capture::read_splats(file);
  if (crop) splats = capture::cropped(splats, *crop);
  return capture::placed(std::move(splats), placement.position, placement.rotation,
                         placement.scale);
}

std::vector<fit::BodySplats> own_splats(const Job& job) {
  std::vector<fit::BodySplats> all;
  const auto add = [&](std::size_t body, const std::string& path, const std::filesystem::path& file,
                       const std::optional<Eigen::AlignedBox3d>& crop) {
    try {
      all.push_back({body, placed_splats(file, crop, job.scene.bodies[body].placement)});
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
      add(b, "output.splats[" + std::to_string(i) + "]", splats.file, splats.crop);
    }
    if (all.size() > before || body.source.kind != Source::Kind::kGaussians) continue;
    add(b, "scene.bodies[" + std::to_string(b) + "].source", body.source.file, body.source.crop);
  }
  return all;
}

}  // namespace matterfit::job
