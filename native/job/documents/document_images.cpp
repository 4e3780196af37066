// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/error.hpp"
#include "capture/colmap.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/images_document.hpp"

namespace matterfit::job {
namespace {

constexpr int kMostCameras = 1'000'000;

Vec3d read_colour(const JsonValue& value) {
  Vec3d colour = value.vec3();
  if (!((colour.array() >= 0.0).all() && (colour.array() <= 1.0).all())) {
    value.fail("a colour, three numbers from 0 to 1");
  }
  return colour;
}

std::vector<int> read_numbers(const JsonValue& value) {
  std::vector<int> numbers;
  for (const JsonValue& item : value.items()) numbers.push_back(item.integer(0, kMostCameras));
  return numbers;
}

/// The name of what cameras belong to: the folder of their file; of a COLMAP model the folder that
/// its `sparse/0` lies in.
std::string name_of(const std::filesystem::path& cameras) {
  const auto model = capture::find_colmap(cameras);
  std::filesystem::path folder =
      std::filesystem::absolute(model ? model->folder : cameras.parent_path()).lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();
  while (model && folder.has_parent_path() && folder != folder.parent_path()) {
    const std::string name = folder.filename().string();
    const bool number = name.find_first_not_of("0123456789") == std::string::npos;
    if (!number && name != "sparse") break;
    folder = folder.parent_path();
  }
  return folder.filename().string();
}

/// Keys that say how a cameras' file becomes cameras of the scene.
void read_world(JsonObject& object, capture::ImageClipOptions& options) {
  if (const auto unit = object.find("unit")) options.unit = read_unit(*unit);
  if (const auto up = object.find("up")) options.up = read_up(*up);
  if (const auto transform = object.find("transform")) {
    const std::array<double, 16> rows = read_matrix(*transform);
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j)
        options.transform(i, j) = rows[4 * std::size_t(i) + std::size_t(j)];
    }
  }
}

capture::ColourKey read_key(const JsonValue& value) {
  JsonObject object(value);
  capture::ColourKey key;
  key.colour = read_colour(object.require("colour"));
  if (const auto range = object.find("range")) {
    const auto items = range->items();
    if (items.size() != 2) range->fail("[low, high], two numbers");
    key.range = {items[0].number(), items[1].number()};
    if (!(key.range[0] < key.range[1])) range->fail("[low, high] with low below high");
  }
  object.finish();
  return key;
}

capture::ClipPlates read_plate(const JsonValue& value, const ReadContext& context) {
  JsonObject object(value);
  capture::ClipPlates plates;
  const JsonValue images = object.require("images");
  if (images.json().is_array()) {
    for (const JsonValue& item : images.items()) plates.files.push_back(context.file(item));
    if (plates.files.empty()) images.fail("a file for each camera, or a name with #");
  } else {
    plates.files.push_back(context.file(images));
  }
  plates.threshold = object.number("threshold", plates.threshold, positive("standard deviations"));
  object.finish();
  return plates;
}

std::vector<fit::CameraPose> read_poses(const JsonValue& value) {
  std::vector<fit::CameraPose> poses;
  for (const JsonValue& item : value.items()) {
    JsonObject object(item);
    fit::CameraPose pose;
    if (const auto shift = object.find("shift")) pose.shift = shift->vec3();
    if (const auto turn = object.find("turn")) pose.turn = turn->vec3();
    if (const auto focal = object.find("focal")) {
      pose.focal = focal->number();
      if (!(pose.focal > -1.0)) focal->fail("a share above -1, 0 for the file's focal length");
    }
    object.finish();
    poses.push_back(pose);
  }
  return poses;
}

std::optional<double> read_colours(const JsonValue& value) {
  constexpr double kUsual = 0.1;
  if (value.json().is_boolean()) return value.boolean() ? std::optional(kUsual) : std::nullopt;
  if (!value.json().is_object()) value.fail("true, or { \"noise\": … }");
  JsonObject object(value);
  const double noise = object.number("noise", kUsual, positive());
  object.finish();
  return noise;
}

std::optional<ImagesDoc::Refine> read_refine(const JsonValue& value) {
  ImagesDoc::Refine refine;
  if (value.json().is_boolean()) return value.boolean() ? std::optional(refine) : std::nullopt;
  if (!value.json().is_object()) {
    value.fail("true, or standard deviations { \"shift\": …, \"turn\": …, \"focal\": … }");
  }
  JsonObject object(value);
  refine.shift = object.number("shift", refine.shift, not_negative("m"));
  refine.turn = object.number("turn", refine.turn, not_negative("rad"));
  refine.focal = object.number("focal", refine.focal, not_negative());
  object.finish();
  return refine;
}

}  // namespace

bool is_by_images(const JsonValue& value) {
  return value.json().is_object() && value.json().contains("cameras");
}

ImagesDoc read_images(const JsonValue& value, const ReadContext& context, const SceneDoc& scene) {
  JsonObject object(value);
  ImagesDoc images;
  images.path = value.path();
  images.cameras = context.file(object.require("cameras"));
  images.name = object.string("name", name_of(images.cameras));
  if (images.name.empty() || images.name.find('/') != std::string::npos) {
    value.refuse("'name' must not be empty or have a / in it.");
  }
  if (const auto body = object.find("body")) images.body = resolve_body(body, value, scene);
  if (const auto folder = object.find("images")) images.options.images = context.file(*folder);
  read_world(object, images.options);
  images.options.fps = object.number("fps", 0.0, positive("frames per second"));
  images.options.default_fps = scene.fps;
  if (const auto key = object.find("key")) images.options.key = read_key(*key);
  if (const auto plate = object.find("plate")) {
    images.options.plates = read_plate(*plate, context);
    if (images.options.key) {
      value.refuse("'key' and 'plate' both say how mattes are made. Give one of them.");
    }
  }
  if (const auto start = object.find("start_frame")) images.start_frame = start->number();
  images.noise = object.number("noise", images.noise, positive("pixels"));
  if (const auto holdout = object.find("holdout")) {
    JsonObject held(*holdout);
    if (const auto frames = held.find("frames")) images.holdout.frames = read_range(*frames);
    if (const auto cameras = held.find("cameras")) images.holdout.cameras = read_numbers(*cameras);
    held.finish();
  }
  if (const auto colours = object.find("colours")) images.colours = read_colours(*colours);
  images.options.colours = images.colours.has_value();
  if (const auto poses = object.find("poses")) images.poses = read_poses(*poses);
  if (const auto refine = object.find("refine")) images.refine = read_refine(*refine);
  object.finish();
  return images;
}

RenderDoc read_render(const JsonValue& value, const ReadContext& context) {
  JsonObject object(value);
  RenderDoc render;
  if (object.one_of({"cameras", "capture"}) == 0) {
    render.cameras = context.file(object.require("cameras"));
    read_world(object, render.options);
    if (const auto poses = object.find("poses")) render.poses = read_poses(*poses);
  } else {
    render.capture = object.require("capture").string();
  }
  if (const auto chosen = object.find("camera")) {
    if (chosen->json().is_number()) {
      render.chosen = {chosen->integer(0, kMostCameras)};
    } else {
      render.chosen = read_numbers(*chosen);
    }
  }
  if (const auto gaussians = object.find("gaussians")) {
    render.gaussians = context.file(*gaussians);
    if (const auto crop = object.find("crop")) render.crop = read_box(*crop);
    render.opacity_threshold =
        object.number("opacity_threshold", render.opacity_threshold, {0.0, 1.0, false, {}});
  }
  if (const auto background = object.find("background")) {
    render.background = read_colour(*background);
  }
  object.finish();
  return render;
}

std::vector<ImagesDoc> images_of(const Job& job) {
  std::vector<ImagesDoc> result;
  if (!job.document.contains("captures")) return result;
  std::size_t place = 0;
  for (const JsonValue& item : JsonValue(job.document.at("captures"), "captures").items()) {
    if (is_by_images(item)) {
      result.push_back(read_images(item, ReadContext{job.base_folder}, job.scene));
      result.back().place = place;
    }
    ++place;
  }
  return result;
}

std::optional<RenderDoc> render_of(const Job& job) {
  if (!job.document.contains("render")) return std::nullopt;
  const JsonValue value(job.document.at("render"), "render");
  RenderDoc render = read_render(value, ReadContext{job.base_folder});
  if (render.capture.empty()) return render;
  for (const ImagesDoc& images : images_of(job)) {
    if (images.name != render.capture) continue;
    render.path = images.path;
    render.cameras = images.cameras;
    render.options = images.options;
    render.poses = images.poses;
    return render;
  }
  throw_input("render.capture: no capture by images is called '" + render.capture + "'.");
}

}  // namespace matterfit::job
