// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/splat_points.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "capture/npz.hpp"
#include "capture/spherical_harmonics.hpp"
#include "capture/splats.hpp"
#include "job/documents/document_reading.hpp"

namespace matterfit::job {
namespace {

constexpr int kMostShown = 100'000'000;
}  // namespace

Json write_splat_points(const std::filesystem::path& path, const Json& options,
                        const std::filesystem::path& npz) {
  JsonObject object(JsonValue(options, "options"));
  const int most = object.integer("most", 20'000, 1, kMostShown);
  const double threshold = object.number("opacity_threshold", 0.0, {0.0, 1.0, false, {}});
  object.finish();
  capture::Splats splats = capture::read_splats(path);
  const std::size_t all = splats.size();
  try {
    splats = capture::chosen(std::move(splats), {}, threshold);
  } catch (const Error& error) {
    throw Error(error.kind(), path.filename().string() + ": " + error.what());
  }
  const std::size_t count = splats.size();
  const std::size_t shown = std::min(count, static_cast<std::size_t>(most));
  Eigen::AlignedBox3d box;
  for (const Vec3f& x : splats.means) box.extend(x.cast<double>());
  std::vector<float> positions;
  std::vector<float> rotations;
  std::vector<float> scales;
  std::vector<float> colours;
  std::vector<float> opacities;
  for (std::size_t n = 0; n < shown; ++n) {
    const std::size_t i = n * count / shown;
    const Eigen::Quaternionf& turn = splats.rotations[i];
    for (const float part : {turn.w(), turn.x(), turn.y(), turn.z()}) rotations.push_back(part);
    for (int axis = 0; axis < 3; ++axis) {
      positions.push_back(splats.means[i][axis]);
      scales.push_back(splats.scales[i][axis]);
      const std::size_t band = 3 * splats.sh_bands() * i + static_cast<std::size_t>(axis);
      colours.push_back(std::clamp(0.5F + capture::kShBand0 * splats.sh[band], 0.0F, 1.0F));
    }
    opacities.push_back(splats.opacities[i]);
  }
  capture::Arrays arrays;
  arrays["positions"] = {{shown, 3}, std::move(positions)};
  arrays["rotations"] = {{shown, 4}, std::move(rotations)};
  arrays["scales"] = {{shown, 3}, std::move(scales)};
  arrays["colours"] = {{shown, 3}, std::move(colours)};
  arrays["opacities"] = {{shown}, std::move(opacities)};
  capture::write_npz(npz, arrays);
  return {{"gaussians", all},
          {"kept", count},
          {"written", shown},
          {"low", {box.min().x(), box.min().y(), box.min().z()}},
          {"high", {box.max().x(), box.max().y(), box.max().z()}}};
}

}  // namespace matterfit::job
