// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/image_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "capture/image_clip.hpp"
#include "fit/data/camera_pose.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/images_document.hpp"

namespace matterfit::job {
namespace {

/// Share of the pixels that the body covers.
double coverage(const capture::Sight& sight) {
  double sum = 0.0;
  for (const std::uint8_t value : sight.matte) sum += value;
  return sum / (255.0 * double(sight.matte.size()));
}

std::string how_mattes_are_made(const capture::ImageClipOptions& options) {
  if (options.plates) return "Mattes by what differs from clean plates";
  if (options.key) return "Mattes by the body's colour";
  return "Mattes of the recording's own: files beside the images, else their alpha";
}

/// Camera to world of Blender's axes, by rows, with the lens.
Json place_of(const splat::Camera& camera) {
  const Vec3d centre = camera.centre();
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) {
    rows.push_back(Json::array(
        {camera.rotation(0, i), -camera.rotation(1, i), -camera.rotation(2, i), centre[i]}));
  }
  rows.push_back(Json::array({0.0, 0.0, 0.0, 1.0}));
  return {{"matrix", rows},  {"width", camera.width}, {"height", camera.height}, {"fx", camera.fx},
          {"fy", camera.fy}, {"cx", camera.cx},       {"cy", camera.cy}};
}

}  // namespace

Json image_summary(const std::filesystem::path& cameras, const Json& options) {
  Json document = options;
  if (!document.is_object()) throw_input("options: expected an object { … }.");
  document["cameras"] = cameras.string();
  document.erase("body");
  SceneDoc scene;
  if (document.contains("scene_fps")) {
    const Json& fps = document["scene_fps"];
    if (!fps.is_number() || !(fps.get<double>() > 0.0)) {
      throw_input("options.scene_fps: expected a number above 0.");
    }
    scene.fps = fps.get<double>();
    document.erase("scene_fps");
  }
  scene.bodies.emplace_back();
  const ImagesDoc doc =
      read_images(JsonValue(document, "options"), ReadContext{std::filesystem::path()}, scene);
  std::vector<std::string> statements;
  double low = 1.0;
  double high = 0.0;
  std::size_t images = 0;
  std::vector<std::string> first;  // image of each camera
  const auto take = [&](const capture::ImageClip& clip, const capture::Sight& sight) {
    first.resize(clip.cameras.size());
    if (first[sight.camera].empty()) first[sight.camera] = sight.image;
    const double share = coverage(sight);
    low = std::min(low, share);
    high = std::max(high, share);
    ++images;
  };
  const capture::ImageClip clip =
      capture::read_image_clip(doc.cameras, doc.options, statements, take);
  const std::vector<splat::Camera> standing = fit::posed(clip.cameras, doc.poses);
  std::set<std::pair<int, int>> sizes;
  Json places = Json::array();
  for (std::size_t k = 0; k < clip.cameras.size(); ++k) {
    const splat::Camera& camera = standing[k];
    sizes.emplace(camera.width, camera.height);
    places.push_back(place_of(camera));
    places.back()["image"] = first[k];
  }
  std::vector<std::string> text;
  const double duration = clip.times.back() - clip.times.front();
  text.push_back(fmt::format("{} cameras, {} images of {} times, {:.3g} s", clip.cameras.size(),
                             images, clip.times.size(), duration));
  constexpr double kFarApart = 1.0;  // s; recordings of motion are faster
  if (clip.times.size() > 2 && duration > kFarApart * double(clip.times.size() - 1)) {
    text.push_back(fmt::format("Its images are {:.3g} s apart; are their times in seconds?",
                               duration / double(clip.times.size() - 1)));
  }
  std::string list;
  for (const auto& [width, height] : sizes) {
    list += fmt::format("{}{} × {}", list.empty() ? "" : ", ", width, height);
  }
  text.push_back("Size " + list + " pixels");
  text.push_back(how_mattes_are_made(doc.options));
  text.push_back(
      fmt::format("The body covers {:.1f} to {:.1f} % of an image", 100.0 * low, 100.0 * high));
  text.insert(text.end(), statements.begin(), statements.end());
  return {{"cameras", clip.cameras.size()},
          {"images", images},
          {"times", clip.times.size()},
          {"duration", duration},
          {"coverage", {low, high}},
          {"places", places},
          {"text", text}};
}

}  // namespace matterfit::job
