// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/error.hpp"
#include "job/documents/capture_scene.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/manifest.hpp"

namespace matterfit::job {
namespace {

/// Names of markers, or their indices, as texts.
std::vector<std::string> read_markers(const JsonValue& value) {
  std::vector<std::string> markers;
  for (const JsonValue& item : value.items()) {
    markers.push_back(item.json().is_number() ? std::to_string(item.integer(0, 1'000'000'000))
                                              : item.string());
  }
  return markers;
}

HoldoutDoc read_holdout(const JsonValue& value) {
  JsonObject object(value);
  HoldoutDoc holdout;
  if (const auto frames = object.find("frames")) holdout.frames = read_range(*frames);
  if (const auto tracks = object.find("tracks")) holdout.tracks = read_markers(*tracks);
  holdout.capture = object.boolean("capture", false);
  object.finish();
  return holdout;
}

SwapDoc read_swap(const JsonValue& value) {
  JsonObject object(value);
  SwapDoc swap;
  swap.sample = static_cast<std::size_t>(object.require("sample").integer(0, 1'000'000'000));
  const JsonValue tracks = object.require("tracks");
  const std::vector<std::string> names = read_markers(tracks);
  if (names.size() != 2 || names[0] == names[1]) tracks.fail("two tracks");
  swap.tracks = {names[0], names[1]};
  object.finish();
  return swap;
}

AlignDoc read_align(const JsonValue& value) {
  JsonObject object(value);
  AlignDoc align;
  align.markers = read_markers(object.require("markers"));
  align.positions = object.require("positions").points();
  const auto range = read_range(object.require("frames"));
  align.begin = range[0];
  align.end = range[1];
  object.finish();
  if (align.markers.size() != align.positions.size()) {
    value.refuse(std::to_string(align.markers.size()) + " markers but " +
                 std::to_string(align.positions.size()) +
                 " positions; give one position a marker.");
  }
  if (align.markers.size() < 3) value.refuse("at least three markers are needed.");
  return align;
}

}  // namespace

double read_unit(const JsonValue& value) {
  if (value.json().is_number()) return value.number(positive("metres per unit"));
  constexpr double kUnits[] = {1.0, 1e-2, 1e-3};
  return kUnits[value.choice({"m", "cm", "mm"})];
}

char read_up(const JsonValue& value) { return "xyzd"[value.choice({"x", "y", "z", "-y"})]; }

std::array<double, 16> read_matrix(const JsonValue& value) {
  std::array<double, 16> matrix{};
  if (value.json().is_object()) {
    const Placement placement = read_placement(value);
    const Mat3d linear = placement.scale * placement.rotation.toRotationMatrix();
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        matrix[4 * i + j] = linear(static_cast<int>(i), static_cast<int>(j));
      }
      matrix[4 * i + 3] = placement.position[static_cast<int>(i)];
    }
    matrix[15] = 1.0;
    return matrix;
  }
  const auto rows = value.items();
  if (rows.size() != 4) value.fail("four rows of four numbers, or {position, rotation, scale}");
  for (std::size_t i = 0; i < 4; ++i) {
    const auto row = rows[i].items();
    if (row.size() != 4) rows[i].fail("four numbers");
    for (std::size_t j = 0; j < 4; ++j) matrix[4 * i + j] = row[j].number();
  }
  if (matrix[12] != 0.0 || matrix[13] != 0.0 || matrix[14] != 0.0 || matrix[15] != 1.0) {
    rows[3].fail("[0, 0, 0, 1] (the matrix maps points, one row after the other)");
  }
  return matrix;
}

std::array<int, 2> read_range(const JsonValue& value) {
  const auto items = value.items();
  if (items.size() != 2) value.fail("[first, end), two frame numbers");
  const std::array<int, 2> range{items[0].integer(-10'000'000, 10'000'000),
                                 items[1].integer(-10'000'000, 10'000'000)};
  if (range[1] <= range[0]) value.fail("a range [first, end) with end after first");
  return range;
}

CaptureDoc read_capture(const JsonValue& value, const ReadContext& context,
                        const JsonValue& scene_value, const SceneDoc& scene) {
  JsonObject object(value);
  CaptureDoc capture;
  capture.path = value.path();
  const JsonValue tracks = object.require("tracks");
  if (tracks.json().is_object()) {
    JsonObject numbered(tracks);
    const JsonValue pattern = numbered.require("pattern");
    capture.file = context.file(pattern);
    numbered.finish();
    if (capture.file.filename().string().find('#') == std::string::npos) {
      pattern.refuse("has no # where the frame number stands, as in cloud_####.ply.");
    }
  } else {
    capture.file = context.file(tracks);
  }
  capture.name = object.string("name", capture.file.stem().string());
  if (capture.name.empty() || capture.name.find('/') != std::string::npos) {
    value.refuse("'name' must not be empty or have a / in it.");
  }
  if (const auto overrides = object.find("scene")) {
    if (!overrides->json().is_object()) overrides->fail("an object { … }");
    if (!overrides->json().empty()) {
      capture.scene_overrides = overrides->json();
      const Json merged =
          merged_scene(scene_value.json(), capture.scene_overrides, overrides->path());
      capture.scene = std::make_shared<const SceneDoc>(
          read_scene(JsonValue(merged, overrides->path()), context));
    }
  }
  capture.body = resolve_body(object.find("body"), value, capture.scene ? *capture.scene : scene);
  if (const auto unit = object.find("unit")) capture.unit = read_unit(*unit);
  if (const auto up = object.find("up")) capture.up = read_up(*up);
  if (const auto transform = object.find("transform")) capture.transform = read_matrix(*transform);
  capture.fps = object.number("fps", 0.0, positive("frames per second"));
  if (const auto markers = object.find("markers")) capture.markers = read_markers(*markers);
  if (const auto start = object.find("start_frame")) capture.start_frame = start->number();
  if (const auto noise = object.find("noise")) capture.noise = noise->number(not_negative("m"));
  if (const auto holdout = object.find("holdout")) capture.holdout = read_holdout(*holdout);
  if (const auto positions = object.find("positions")) {
    capture.positions = positions->points();
    if (!capture.markers.empty() && capture.positions.size() != capture.markers.size()) {
      positions->refuse(std::to_string(capture.positions.size()) + " positions for " +
                        std::to_string(capture.markers.size()) + " markers; give one a marker.");
    }
  }
  if (const auto align = object.find("align")) {
    capture.align = read_align(*align);
    if (object.has("transform")) {
      value.refuse("has both 'transform' and 'align'; keep one.");
    }
  }
  if (const auto swaps = object.find("swaps")) {
    for (const JsonValue& item : swaps->items()) capture.swaps.push_back(read_swap(item));
  }
  if (const auto front = object.find("front")) capture.front = front->unit_vec3();
  if (const auto release = object.find("release")) capture.release = release->number();
  object.finish();
  return capture;
}

ProbeDoc read_probe(const JsonValue& value, const ReadContext& context, const SceneDoc& scene) {
  JsonObject object(value);
  ProbeDoc probe;
  probe.name = object.require("name").string();
  if (probe.name.empty()) value.refuse("'name' is empty.");
  probe.body = resolve_body(object.find("body"), value, scene);
  probe.region = read_region(object.require("region"), context);
  object.finish();
  return probe;
}

OutputDoc read_output(const JsonValue& value, const ReadContext& context, const SceneDoc& scene) {
  JsonObject object(value);
  OutputDoc output;
  const auto folder = object.find("folder");
  output.folder = folder ? context.file(*folder) : (context.base_folder / "out").lexically_normal();
  if (!output.folder.has_filename()) output.folder = output.folder.parent_path();  // "out/", "."
  if (const auto volume = object.find("volume")) {
    for (const JsonValue& item : volume->items()) {
      bool* const grids[] = {&output.density, &output.velocity, &output.surface};
      *grids[item.choice({"density", "velocity", "surface"})] = true;
    }
  }
  output.voxel_size = object.number("voxel_size", 0.0, not_negative("m"));
  output.points = object.boolean("points", false);
  if (const auto meshes = object.find("mesh")) {
    for (const JsonValue& item : meshes->items()) {
      JsonObject mesh(item);
      MeshOutput read;
      read.cage = mesh.one_of({"mesh", "cage"}) == 1;
      read.file = context.file(mesh.require(read.cage ? "cage" : "mesh"));
      if (read.cage) read.level = mesh.integer("level", read.level, 0, 6);
      read.name = mesh.string("name", read.file.stem().string());
      if (read.name.empty() || read.name.find('/') != std::string::npos) {
        item.refuse("'name' must not be empty or have a / in it.");
      }
      read.body = resolve_body(mesh.find("body"), item, scene);
      if (const auto transform = mesh.find("transform")) {
        read.transform = read_placement(*transform);
      }
      mesh.finish();
      for (const MeshOutput& other : output.mesh) {
        if (other.name == read.name) item.refuse("the name '" + read.name + "' is taken.");
      }
      output.mesh.push_back(read);
    }
  }
  if (const auto splats = object.find("splats")) {
    for (const JsonValue& item : splats->items()) {
      JsonObject splat(item);
      SplatOutput read;
      read.file = context.file(splat.require("gaussians"));
      read.name = splat.string("name", read.file.stem().string());
      if (read.name.empty() || read.name.find('/') != std::string::npos) {
        item.refuse("'name' must not be empty or have a / in it.");
      }
      read.body = resolve_body(splat.find("body"), item, scene);
      if (const auto crop = splat.find("crop")) read.crop = read_box(*crop);
      read.opacity_threshold =
          splat.number("opacity_threshold", read.opacity_threshold, {0.0, 1.0, false, {}});
      if (const auto format = splat.find("format")) {
        read.dot_splat = format->choice({"ply", "splat"}) == 1;
      }
      splat.finish();
      for (const SplatOutput& other : output.splats) {
        if (other.name == read.name) item.refuse("the name '" + read.name + "' is taken.");
      }
      output.splats.push_back(read);
    }
  }
  if (const auto attributes = object.find("attributes")) {
    for (const JsonValue& item : attributes->items()) {
      (void)item.choice(
          {"velocity", "plastic_strain", "volume_ratio", "stretch", "rotation", "scale"});
      output.attributes.push_back(item.string());
    }
  }
  output.overlays = object.boolean("overlays", false);
  output.bake = object.boolean("bake", false);
  if (const auto report = object.find("report")) {
    output.report = report->string();
    if (!stays_inside(output.report)) {
      report->refuse("'" + output.report +
                     "' is not a plain file name in the output folder, as in "
                     "\"report.json\".");
    }
  }
  if (const auto checkpoint = object.find("checkpoint")) {
    JsonObject every(*checkpoint);
    output.checkpoint_frames = every.integer("frames", output.checkpoint_frames, 1, 1'000'000);
    output.checkpoint_seconds = every.number("seconds", output.checkpoint_seconds, positive("s"));
    every.finish();
  }
  object.finish();
  return output;
}

}  // namespace matterfit::job
