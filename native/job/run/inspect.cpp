// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/inspect.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "capture/check.hpp"
#include "capture/colmap.hpp"
#include "capture/splats.hpp"
#include "capture/tracks.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/manifest.hpp"
#include "job/run/image_summary.hpp"

namespace matterfit::job {
namespace {

Json json_of(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

float median(std::vector<float> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Json splats_summary(const capture::Splats& splats) {
  Eigen::AlignedBox3d box;
  std::vector<float> sizes;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    box.extend(splats.means[i].cast<double>());
    sizes.push_back(std::cbrt(splats.scales[i].prod()));
  }
  const float size = median(sizes);
  const float opacity = median(splats.opacities);
  const std::vector<std::string> text = {
      fmt::format("{} splats, harmonics of degree {}{}", splats.size(), splats.sh_degree,
                  splats.isotropic ? ", isotropic" : ""),
      fmt::format("Centres from ({:.4g}, {:.4g}, {:.4g}) to ({:.4g}, {:.4g}, {:.4g})",
                  box.min().x(), box.min().y(), box.min().z(), box.max().x(), box.max().y(),
                  box.max().z()),
      fmt::format("Median of the size {:.3g}, of the opacity {:.3g}", size, opacity)};
  return {{"gaussians", splats.size()},    {"sh_degree", splats.sh_degree},
          {"isotropic", splats.isotropic}, {"low", json_of(box.min())},
          {"high", json_of(box.max())},    {"median_size", size},
          {"median_opacity", opacity},     {"text", text}};
}

}  // namespace

Json inspect_folder(const std::filesystem::path& folder) {
  const auto manifest = read_manifest(folder);
  if (!manifest) {
    const bool begun = std::filesystem::exists(folder / "result.json");
    throw_input(folder.string() +
                (begun
                     ? ": holds a job that did not come to its end: there is no manifest.json to "
                       "check files by. Run the job again; it goes on."
                     : ": there is no manifest.json in it; it is not the output folder of a job."));
  }
  Json faults = Json::array();
  Manifest found = *manifest;
  // From what lies there now: a damaged file changes the hash, a missing one as well. Files without
  // a fault have just been seen to have the hash that is listed.
  for (const auto& [path, what] : verify_files(*manifest, folder)) {
    faults.push_back({{"path", path}, {"what", what}});
    Manifest::File& file = found.files.at(path);
    if (!file.is_result) continue;
    std::error_code code;
    if (std::filesystem::is_regular_file(folder / path, code)) {
      record_file(found, folder, path, true);
    } else {
      file.hash = "missing";
    }
  }
  std::uint64_t bytes = 0;
  for (const auto& [path, file] : manifest->files) bytes += file.size;
  return {{"status", faults.empty() ? "sound" : "damaged"},
          {"task", manifest->task},
          {"version", manifest->version},
          {"folder", folder.string()},
          {"input_hash", manifest->input_hash},
          {"result_hash", result_hash(found)},
          {"fps", manifest->fps_given},
          {"frames", {manifest->first_frame, manifest->end_frame}},
          {"frames_done", manifest->frames_done},
          {"frames_baked", manifest->frames_baked},
          {"complete", manifest->complete},
          {"grids", manifest->grids},
          {"bodies", manifest->bodies},
          {"files", manifest->files.size()},
          {"bytes", bytes},
          {"faults", faults}};
}

Json capture_summary(const std::filesystem::path& path, const Json& options) {
  if (options.contains("cameras") || path.extension() == ".json" || capture::find_colmap(path)) {
    return image_summary(path, options);
  }
  // The keys of a capture; the file is named apart, and no scene is needed.
  Json document = options;
  if (!document.is_object()) throw_input("options: expected an object { … }.");
  document["tracks"] = path.string();
  document.erase("body");
  SceneDoc scene;
  scene.bodies.emplace_back();
  document.erase("scene");
  const Json no_scene = Json::object();
  const CaptureDoc doc =
      read_capture(JsonValue(document, "options"), ReadContext{std::filesystem::path()},
                   JsonValue(no_scene, "scene"), scene);
  capture::TracksOptions read;
  read.unit = doc.unit;
  read.up = doc.up;
  read.fps = doc.fps > 0.0 ? doc.fps : 24.0;
  read.markers = doc.markers;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      read.transform(i, j) =
          doc.transform[4 * static_cast<std::size_t>(i) + static_cast<std::size_t>(j)];
    }
  }
  const capture::Tracks tracks = capture::read_tracks(doc.file, read);
  const capture::CaptureSummary summary = capture::summarise(tracks);
  Json jumps = Json::array();
  for (const capture::Jump& jump : summary.jumps) {
    jumps.push_back({{"point", jump.point}, {"frame", jump.frame}, {"size_m", jump.size}});
  }
  Json gaps = Json::array();
  for (const capture::TimeGap& gap : summary.gaps) {
    gaps.push_back({{"frame", gap.frame}, {"seconds", gap.seconds}});
  }
  constexpr std::size_t kMostPoints = 4096;
  Json json = {{"frames", summary.frames},
               {"points", summary.points},
               {"duration", summary.duration},
               {"spacing", summary.spacing},
               {"fps", summary.spacing > 0.0 ? 1.0 / summary.spacing : 0.0},
               {"irregular", summary.irregular},
               {"gaps", gaps},
               {"low", json_of(summary.low)},
               {"high", json_of(summary.high)},
               {"unit_warning", summary.unit_warning},
               {"jumps", jumps},
               {"jump_count", summary.jump_count},
               {"exchanged", summary.exchanged},
               {"missing", summary.missing},
               {"never_visible", summary.never_visible.size()},
               {"noise", summary.noise},
               {"labels", tracks.labels},
               {"text", summary.text}};
  if (summary.point_noise.size() <= kMostPoints) json["point_noise"] = summary.point_noise;
  return json;
}

Json file_summary(const std::filesystem::path& path) {
  if (capture::is_of_splats(path)) return splats_summary(capture::read_splats(path));
  return capture_summary(path, Json::object());
}

}  // namespace matterfit::job
