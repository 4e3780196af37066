// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_sightings.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "capture/image_clip.hpp"
#include "fit/data/follow.hpp"
#include "job/documents/images_document.hpp"

namespace matterfit::job {
namespace {

constexpr double kSlack = 1e-6;  // frames
constexpr double kPixelsASeparation = 2.0;
constexpr int kWidestReduced = 128;

/// How many times larger the pixels are that a fit compares.
int factor_of(const splat::Camera& camera, const mpm::Scene& scene) {
  Vec3d centre = Vec3d::Zero();
  double count = 0.0;
  for (const mpm::Body& body : scene.bodies) {
    for (const Vec3d& x : body.rest) centre += x;
    count += double(body.rest.size());
  }
  centre /= std::max(1.0, count);
  const double distance = (camera.rotation * centre + camera.translation).norm();
  const double pixels = camera.fx * 0.5 * scene.dx / std::max(distance, 1e-9);
  const int by_separation = static_cast<int>(std::floor(pixels / kPixelsASeparation));
  const int by_width = (camera.width + kWidestReduced - 1) / kWidestReduced;
  const int most = std::min(camera.width, camera.height) / 8;
  return std::clamp(std::max(by_separation, by_width), 1, std::max(1, most));
}

bool is_held_out(const ImagesDoc& doc, double frame, std::size_t camera) {
  const auto& held = doc.holdout;
  const bool by_camera = std::find(held.cameras.begin(), held.cameras.end(),
                                   static_cast<int>(camera)) != held.cameras.end();
  return by_camera ||
         (held.frames && frame >= (*held.frames)[0] - kSlack && frame < (*held.frames)[1] - kSlack);
}

void add_capture(const ImagesDoc& doc, const mpm::Scene& scene, std::size_t first_camera,
                 std::vector<ImageSighting>& all, std::size_t& cameras,
                 std::vector<std::string>& statements) {
  capture::ImageClip clip = capture::read_image_clip(doc.cameras, doc.options, statements);
  cameras = clip.cameras.size();
  for (const int number : doc.holdout.cameras) {
    if (static_cast<std::size_t>(number) < cameras) continue;
    throw_input("there is no camera " + std::to_string(number) + " to hold out; there are " +
                std::to_string(cameras) + ", from 0.");
  }
  const double start = doc.start_frame.value_or(scene.first_frame);
  std::size_t outside = 0;
  for (capture::Sight& sight : clip.sights) {
    const double frame = start + clip.times[sight.frame] * scene.fps;
    if (frame < scene.first_frame - kSlack || frame > scene.end_frame - 1 + kSlack) {
      ++outside;
      continue;
    }
    ImageSighting one;
    one.camera = clip.cameras[sight.camera];
    one.camera_number = static_cast<int>(sight.camera);
    one.reduced.held_out = is_held_out(doc, frame, sight.camera);
    one.capture = doc.name;
    one.image = sight.image;
    const int factor = factor_of(one.camera, scene);
    one.reduced.matte = fit::reduced(sight.matte, one.camera.width, one.camera.height, factor);
    one.seen = clip.seen[sight.camera];
    if (!one.seen.empty()) {
      one.reduced.seen = fit::reduced(one.seen, one.camera.width, one.camera.height, factor).values;
    }
    one.reduced.noise = doc.noise / factor;
    one.reduced.camera = first_camera + sight.camera;
    one.reduced.view.camera = fit::reduced(one.camera, factor);
    one.reduced.view.time = std::clamp((frame - scene.first_frame) / scene.fps, 0.0,
                                       (scene.end_frame - 1 - scene.first_frame) / scene.fps);
    if (!doc.body.empty()) one.reduced.view.body = fit::body_index(scene, doc.body);
    one.matte = std::move(sight.matte);
    all.push_back(std::move(one));
  }
  if (outside > 0) {
    statements.push_back("captures." + doc.name + ": " + std::to_string(outside) +
                         " images lie outside of the scene's frames.");
  }
}

}  // namespace

std::vector<ImageSighting> load_sightings(const Job& job, const mpm::Scene& scene,
                                          std::vector<std::string>& statements) {
  std::vector<ImageSighting> all;
  std::size_t cameras = 0;
  for (const ImagesDoc& doc : images_of(job)) {
    std::size_t more = 0;
    try {
      add_capture(doc, scene, cameras, all, more, statements);
    } catch (const Error& error) {
      throw Error(error.kind(), doc.path + ": " + error.what());
    }
    cameras += more;
  }
  std::stable_sort(all.begin(), all.end(), [](const ImageSighting& a, const ImageSighting& b) {
    return a.reduced.view.time < b.reduced.view.time;
  });
  if (std::all_of(all.begin(), all.end(),
                  [](const ImageSighting& s) { return s.reduced.held_out; })) {
    throw_input(
        "captures: every image is held out or outside of the scene's frames; nothing is left to "
        "fit to. Shorten a 'holdout', or look at start_frame, fps and scene.frames.");
  }
  return all;
}

Json silhouettes_json(const std::vector<ImageSighting>& sightings,
                      const std::vector<fit::Agreement>& agreements) {
  Json result;
  for (const bool held_out : {false, true}) {
    double iou = 0.0;
    double contour = 0.0;
    int images = 0;
    int contours = 0;
    std::size_t worst = 0;
    for (std::size_t k = 0; k < sightings.size(); ++k) {
      if (sightings[k].reduced.held_out != held_out) continue;
      if (images == 0 || agreements[k].iou < agreements[worst].iou) worst = k;
      ++images;
      iou += agreements[k].iou;
      if (!std::isfinite(agreements[k].contour_px)) continue;
      contour += agreements[k].contour_px;
      ++contours;
    }
    Json part;
    if (images > 0) {
      part = {{"images", images},
              {"iou", iou / images},
              {"contour_px", contours > 0 ? Json(contour / contours) : Json()},
              {"worst",
               {{"image", sightings[worst].image},
                {"iou", agreements[worst].iou},
                {"outside_px", agreements[worst].outside},
                {"missing_px", agreements[worst].missing}}}};
    }
    result[held_out ? "held_out" : "fitted"] = part;
  }
  return result;
}

}  // namespace matterfit::job
