// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/render.hpp"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <utility>

#include "bake/picture.hpp"
#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/cameras.hpp"
#include "capture/particle_gaussians.hpp"
#include "capture/particles.hpp"
#include "capture/splats.hpp"
#include "capture/tracks.hpp"
#include "fit/data/camera_pose.hpp"
#include "fit/model/particle_sizes.hpp"
#include "job/documents/images_document.hpp"
#include "job/documents/inputs.hpp"
#include "job/run/bake_outputs.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/own_splats.hpp"
#include "job/run/run_scene.hpp"
#include "job/run/state_file.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

struct Place {
  int number = 0;
  splat::Camera camera;
  bool lens = false;  ///< its images are distorted, its pictures are not
};

std::vector<Place> places(const RenderDoc& doc) {
  const capture::CameraSet set = [&] {
    try {
      return capture::read_cameras(doc.cameras, doc.options.images);
    } catch (const Error& error) {
      throw Error(error.kind(), doc.path + ".cameras: " + error.what());
    }
  }();
  const Eigen::Matrix4d matrix =
      capture::tracks_matrix(doc.options.unit, doc.options.up, doc.options.transform);
  std::vector<int> numbers = doc.chosen;
  std::vector<splat::Camera> cameras;
  for (const splat::Camera& camera : set.cameras) {
    cameras.push_back(capture::moved(camera, matrix));
  }
  cameras = fit::posed(std::move(cameras), doc.poses);
  const int count = static_cast<int>(cameras.size());
  if (numbers.empty()) {
    for (int k = 0; k < count; ++k) numbers.push_back(k);
  }
  std::vector<Place> result;
  result.reserve(numbers.size());
  for (const int number : numbers) {
    if (number >= count) {
      throw_input("render.camera: there is no camera " + std::to_string(number) + "; " +
                  doc.cameras.string() + " has " + std::to_string(count) + ", from 0.");
    }
    const auto k = static_cast<std::size_t>(number);
    result.push_back({number, cameras[k], !set.lenses[k].none()});
  }
  return result;
}

/// Draws and counts what is written.
class Painter {
 public:
  Painter(const Job& job, const RenderDoc& doc, const RunOptions& options)
      : doc_(doc),
        folder_(job.output.folder),
        places_(places(doc_)),
        arena_(std::make_shared<Arena>(options.threads)),
        rasteriser_(arena_, resolve_target(options.target)) {}

  [[nodiscard]] Arena& arena() { return *arena_; }

  /// `name`: what stands between camera_N and .png.
  void draw(const splat::Gaussians& gaussians, bool antialiased, const std::string& name) {
    splat::RenderOptions options;
    options.antialiased = antialiased;
    for (const Place& place : places_) {
      const splat::Image& image = rasteriser_.render(gaussians, place.camera, options);
      seen_ = seen_ || std::any_of(image.mask.begin(), image.mask.end(),
                                   [](float mask) { return mask > 0.5F; });
      const std::string file = "render/camera_" + std::to_string(place.number) + name + ".png";
      capture::write_png(folder_ / file, bake::picture(image, doc_.background));
      files_.push_back(file);
    }
  }

  [[nodiscard]] const std::vector<std::string>& files() const { return files_; }
  [[nodiscard]] Json json() const {
    Json notes = Json::array();
    if (!seen_) {
      notes.push_back(
          "render: no camera sees anything. Do they look the right way, and is 'up' or "
          "'unit' right?");
    }
    if (std::any_of(places_.begin(), places_.end(),
                    [](const Place& place) { return place.lens; })) {
      notes.push_back(
          "render: cameras have a lens that distorts; the pictures are what their images show when "
          "these are undistorted.");
    }
    return {{"pictures", files_.size()},
            {"cameras", places_.size()},
            {"files", files_},
            {"notes", notes}};
  }

 private:
  const RenderDoc& doc_;
  fs::path folder_;
  std::vector<Place> places_;
  std::shared_ptr<Arena> arena_;
  splat::Rasteriser rasteriser_;
  std::vector<std::string> files_;
  bool seen_ = false;
};

capture::Splats chosen_splats(const RenderDoc& doc) {
  try {
    return capture::chosen(capture::read_splats(doc.gaussians), doc.crop, doc.opacity_threshold);
  } catch (const Error& error) {
    throw Error(error.kind(), std::string("render.gaussians: ") + error.what());
  }
}

Json draw_still(const Job& job, const RenderDoc& doc, const RunOptions& options) {
  Painter painter(job, doc, options);
  const capture::Splats splats = chosen_splats(doc);
  painter.draw(capture::gaussians_of(splats), splats.antialiased, "");
  Json result = {{"status", "complete"},
                 {"task", "render"},
                 {"version", MATTERFIT_VERSION},
                 {"folder", job.output.folder.string()},
                 {"render", painter.json()}};
  write_file(job.output.folder / "result.json",
             result.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  return result;
}

/// A body's particles, or the splats that stand for it: as they were baked, or those of which it
/// was filled.
splat::Gaussians gaussians_of_body(const Job& job, const mpm::Scene& scene, std::size_t k,
                                   std::span<const fit::OwnSplats> own,
                                   const mpm::FrameState& state, const std::vector<Vec3f>& colours,
                                   Arena& arena) {
  const mpm::Body& body = scene.bodies[k];
  splat::Gaussians all;
  for (const SplatOutput& splats : job.output.splats) {
    if (splats.body != body.name) continue;
    const std::string file = splat_path(splats, state.frame);
    splat::append(all, capture::gaussians_of(capture::read_splats(job.output.folder / file)));
  }
  if (all.size() > 0) return all;
  const double separation = 0.5 * scene.dx;
  const capture::ParticleView view = capture::particle_view(body, state.bodies[k], separation);
  for (const fit::OwnSplats& one : own) {
    if (one.body == k) splat::append(all, one.splats.at(view, arena));
  }
  if (all.size() > 0) return all;
  all = capture::particle_gaussians(
      view.positions,
      capture::carries_shape(body) ? view.deformation_gradients : std::span<const Mat3f>{},
      fit::kUsualSize * separation);
  capture::set_colours(all, colours);
  return all;
}

}  // namespace

Json run_render(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  const std::optional<RenderDoc> doc = render_of(job);
  if (!doc) {
    throw_input(
        "'render' is missing: pictures need \"render\": { \"cameras\": \"transforms.json\" }.");
  }
  if (!doc->gaussians.empty()) return draw_still(job, *doc, options);
  Job simulated = job;
  simulated.task = job.output.splats.empty() ? Task::kSimulate : Task::kBake;
  simulated.captures.clear();
  (void)places(*doc);  // a wrong camera is told before the simulation
  RunExtras extras;
  extras.task = task_name(Task::kRender);
  extras.finish = [&](Json& result) {
    Painter painter(job, *doc, options);
    const BuiltScene built = build_scene(simulated, painter.arena(), interrupter);
    const mpm::Scene& scene = built.scene;
    const std::vector<fit::OwnSplats> own =
        fit::carried(own_splats(simulated), scene, painter.arena(), &interrupter);
    const bool antialiased = std::ranges::any_of(
        own, [](const fit::OwnSplats& one) { return one.splats.rest().antialiased; });
    std::vector<std::vector<Vec3f>> colours;
    for (std::size_t k = 0; k < scene.bodies.size(); ++k) {
      colours.push_back(bake::block_colours(scene.bodies[k].rest, 0.5 * scene.dx, k));
    }
    for (int frame = scene.first_frame; frame < scene.end_frame; ++frame) {
      Progress progress;
      progress.label = "Drawing";
      progress.frame = frame;
      progress.last_frame = scene.end_frame - 1;
      progress.fraction = 1.0;
      interrupter.report(progress);
      interrupter.check();
      const mpm::FrameState state = read_state(job.output.folder / state_path(frame), scene);
      splat::Gaussians all;
      for (std::size_t k = 0; k < scene.bodies.size(); ++k) {
        splat::append(all,
                      gaussians_of_body(job, scene, k, own, state, colours[k], painter.arena()));
      }
      painter.draw(all, antialiased, "/" + frame_digits(frame));
    }
    result["render"] = painter.json();
    return painter.files();
  };
  return run_scenes(simulated, options, interrupter, extras);
}

}  // namespace matterfit::job
