// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/cameras.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/camera_shots.hpp"
#include "capture/colmap.hpp"
#include "capture/image_file.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kOrthonormal = 1e-3;  // matrices are often written with few digits

/// One frame's keys before those that hold for all.
class FrameEntry {
 public:
  FrameEntry(const Json& frame, const Json* all, std::string where)
      : frame_(frame), all_(all), where_(std::move(where)) {
    if (!frame.is_object()) fail("is not an object { … }.");
  }

  [[noreturn]] void fail(const std::string& reason) const { throw_input(where_ + " " + reason); }
  [[nodiscard]] const std::string& where() const { return where_; }
  [[nodiscard]] const Json* find(const char* key) const {
    if (const auto own = frame_.find(key); own != frame_.end() && !own->is_null()) return &*own;
    if (all_ == nullptr) return nullptr;
    const auto shared = all_->find(key);
    return shared == all_->end() || shared->is_null() ? nullptr : &*shared;
  }
  [[nodiscard]] std::optional<double> number(const char* key) const {
    const Json* value = find(key);
    if (value == nullptr) return std::nullopt;
    if (!value->is_number() || !std::isfinite(value->get<double>())) {
      fail(std::string("has a '") + key + "' that is no number.");
    }
    return value->get<double>();
  }
  [[nodiscard]] std::string text(const char* key) const {
    const Json* value = find(key);
    if (value == nullptr) return {};
    if (!value->is_string()) fail(std::string("has a '") + key + "' that is no text.");
    return value->get<std::string>();
  }
  template <int Rows, int Columns>
  [[nodiscard]] Eigen::Matrix<double, Rows, Columns> matrix(const char* key) const {
    Eigen::Matrix<double, Rows, Columns> result;
    const Json* rows = find(key);
    if (rows == nullptr) fail(std::string("has no '") + key + "'.");
    const std::string expected = std::string("has a '") + key + "' that is not " +
                                 std::to_string(Rows) + " rows of " + std::to_string(Columns) +
                                 " numbers.";
    if (!rows->is_array() || rows->size() < Rows) fail(expected);
    for (int i = 0; i < Rows; ++i) {
      const Json& row = (*rows)[static_cast<std::size_t>(i)];
      if (!row.is_array() || row.size() != Columns) fail(expected);
      for (int j = 0; j < Columns; ++j) {
        const Json& value = row[static_cast<std::size_t>(j)];
        if (!value.is_number() || !std::isfinite(value.get<double>())) fail(expected);
        result(i, j) = value.get<double>();
      }
    }
    return result;
  }

 private:
  const Json& frame_;
  const Json* all_;
  std::string where_;
};

/// World to camera of OpenCV's axes from camera to world of OpenGL's.
void set_pose(const Eigen::Matrix<double, 3, 4>& to_world, const FrameEntry& entry,
              splat::Camera& camera) {
  const Mat3d axes = to_world.leftCols<3>();
  if (!((axes.transpose() * axes - Mat3d::Identity()).norm() < kOrthonormal) ||
      !(axes.determinant() > 0.0)) {
    entry.fail("has a camera whose matrix is no rotation and shift; divide out its scale.");
  }
  const Mat3d turn = Quatd(axes).normalized().toRotationMatrix();
  const Vec3d flip(1.0, -1.0, -1.0);
  camera.rotation = flip.asDiagonal() * turn.transpose();
  camera.translation = -(camera.rotation * to_world.col(3));
}

/// Half the angle of view to a focal length.
double focal_of(double angle, int pixels) { return 0.5 * pixels / std::tan(0.5 * angle); }

/// The lens of a frame, of those of Nerfstudio's models that have radial and tangential distortion.
Distortion nerfstudio_lens(const FrameEntry& entry) {
  const std::string model = entry.text("camera_model");
  const auto read = {"", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"};
  if (std::find(read.begin(), read.end(), model) == read.end()) {
    entry.fail("has the 'camera_model' " + model +
               ", which is not read; PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL and OPENCV "
               "are. Undistort the images first, as `colmap image_undistorter` does.");
  }
  const double k4 = entry.number("k4").value_or(0.0);
  if (k4 != 0.0) {
    entry.fail("has lens distortion by k4 = " + std::to_string(k4) +
               "; k1, k2, k3, p1 and p2 are read. Calibrate again without it, or undistort the "
               "images first.");
  }
  Distortion lens;
  lens.k1 = entry.number("k1").value_or(0.0);
  lens.k2 = entry.number("k2").value_or(0.0);
  lens.k3 = entry.number("k3").value_or(0.0);
  lens.p1 = entry.number("p1").value_or(0.0);
  lens.p2 = entry.number("p2").value_or(0.0);
  return lens;
}

splat::Camera nerfstudio_camera(const FrameEntry& entry, const std::string& image,
                                const ImageSize& size) {
  splat::Camera camera;
  const auto width = entry.number("w");
  const auto height = entry.number("h");
  if (width && height) {
    for (const double edge : {*width, *height}) {
      if (!(edge >= 1.0) || edge > kMostImageEdge || edge != std::floor(edge)) {
        entry.fail("has an image size of " + std::to_string(edge) + " pixels.");
      }
    }
    camera.width = static_cast<int>(*width);
    camera.height = static_cast<int>(*height);
  } else {
    const auto pixels = size(image);
    camera.width = pixels[0];
    camera.height = pixels[1];
    if ((width && *width != camera.width) || (height && *height != camera.height)) {
      entry.fail("is " + std::to_string(camera.width) + " × " + std::to_string(camera.height) +
                 " pixels large, and its '" + (width ? "w" : "h") + "' says something else.");
    }
  }
  const auto fx = entry.number("fl_x");
  const auto fy = entry.number("fl_y");
  const auto angle_x = entry.number("camera_angle_x");
  const auto angle_y = entry.number("camera_angle_y");
  if (fx) {
    camera.fx = *fx;
  } else if (angle_x) {
    camera.fx = focal_of(*angle_x, camera.width);
  } else {
    entry.fail("has no focal length: neither 'fl_x' nor 'camera_angle_x'.");
  }
  camera.fy = fy ? *fy : !fx && angle_y ? focal_of(*angle_y, camera.height) : camera.fx;
  camera.cx = entry.number("cx").value_or(0.5 * camera.width);
  camera.cy = entry.number("cy").value_or(0.5 * camera.height);
  set_pose(entry.matrix<3, 4>("transform_matrix"), entry, camera);
  return camera;
}

splat::Camera pacnerf_camera(const FrameEntry& entry, const std::string& image,
                             const ImageSize& size) {
  splat::Camera camera;
  const auto pixels = size(image);
  camera.width = pixels[0];
  camera.height = pixels[1];
  const Mat3d lens = entry.matrix<3, 3>("intrinsic");
  camera.fx = lens(0, 0);
  camera.fy = lens(1, 1);
  camera.cx = lens(0, 2);
  camera.cy = lens(1, 2);
  set_pose(entry.matrix<3, 4>("c2w"), entry, camera);
  return camera;
}

Json parsed(std::string_view text, const std::string& name) {
  try {
    return Json::parse(text);
  } catch (const Json::parse_error& error) {
    const std::string_view before = text.substr(0, std::min(error.byte, text.size()));
    const std::string place = "line " + std::to_string(1 + std::ranges::count(before, '\n')) +
                              ", column " +
                              std::to_string(before.size() - (before.rfind('\n') + 1));
    if (error.byte > text.size()) {
      throw_input(name + ": is no JSON text: it ends at " + place +
                  " in the middle. Is it cut off? Export it again.");
    }
    throw_input(name + ": is no JSON text: it cannot be read on from " + place +
                ". Is a comma missing, or one too many? JSON has no NaN and no infinity either.");
  } catch (const Json::exception&) {
    throw_input(name + ": is no JSON text: a number in it is beyond what a double holds.");
  }
}

/// Says of an image of which one of two numbers that go together is given: the other may be
/// misspelled.
void note_half_pairs(const FrameEntry& entry, std::vector<std::string>& notes) {
  for (const std::array<const char*, 2>& pair : {std::array{"cx", "cy"}, std::array{"w", "h"}}) {
    const bool first = entry.find(pair[0]) != nullptr;
    if (first == (entry.find(pair[1]) != nullptr)) continue;
    const std::string said = std::string(" gives '") + (first ? pair[0] : pair[1]) + "' and no '" +
                             (first ? pair[1] : pair[0]) +
                             "', which is taken from the image's size.";
    const bool known =
        std::ranges::any_of(notes, [&](const std::string& note) { return note.ends_with(said); });
    if (!known) notes.push_back(entry.where() + said);
  }
}

std::string with_ending(std::string image) {
  if (fs::path(image).extension().empty()) image += ".png";
  return image;
}

}  // namespace

CameraSet parse_cameras(std::string_view text, const std::string& name, const ImageSize& size) {
  const Json json = parsed(text, name);
  const bool pacnerf = json.is_array();
  if (!pacnerf && !(json.is_object() && json.contains("frames") && json["frames"].is_array())) {
    throw_input(name +
                ": is neither a transforms.json (an object with a list 'frames') nor an "
                "all_data.json (a list of images).");
  }
  const Json& frames = pacnerf ? json : json["frames"];
  if (frames.empty()) throw_input(name + ": its cameras have no images.");
  if (frames.size() > kMostImages) throw_input(name + ": has more than a million images.");
  CameraSet set;
  set.source = name;
  set.shots.reserve(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const FrameEntry entry(frames[i], pacnerf ? nullptr : &json,
                           name + ": image " + std::to_string(i));
    Shot shot;
    shot.image = entry.text("file_path");
    if (shot.image.empty()) entry.fail("has no 'file_path'.");
    shot.image = with_ending(shot.image);
    if (!pacnerf) shot.mask = entry.text("mask_path");
    if (!pacnerf) note_half_pairs(entry, set.notes);
    shot.time = entry.number("time");
    shot.number = last_digits(shot.image);
    const splat::Camera camera = pacnerf ? pacnerf_camera(entry, shot.image, size)
                                         : nerfstudio_camera(entry, shot.image, size);
    add_shot(set, std::move(shot), camera, pacnerf ? Distortion{} : nerfstudio_lens(entry),
             entry.where());
  }
  return set;
}

CameraSet read_cameras(const fs::path& path, const fs::path& images) {
  if (const auto place = find_colmap(path)) return read_colmap(*place, images);
  std::error_code code;
  if (fs::is_directory(path, code)) {
    throw_input(path.string() +
                ": holds no COLMAP model: neither cameras.bin and images.bin nor cameras.txt and "
                "images.txt, here, in sparse or in sparse/0. Name the folder that has them, or a "
                "transforms.json.");
  }
  const fs::path folder = images.empty() ? path.parent_path() : images;
  const auto bytes = read_file(path, std::uint64_t{1} << 28U);
  const auto size = [&](const std::string& image) { return image_size(folder / image); };
  CameraSet set = parse_cameras({reinterpret_cast<const char*>(bytes.data()), bytes.size()},
                                path.string(), size);
  set.folder = folder;
  return set;
}

std::string format_cameras(const CameraSet& set) {
  Json frames = Json::array();
  for (const Shot& shot : set.shots) {
    const splat::Camera& camera = set.cameras[shot.camera];
    const Vec3d flip(1.0, -1.0, -1.0);
    const Mat3d axes = camera.rotation.transpose() * flip.asDiagonal();
    const Vec3d centre = camera.centre();
    Json rows = Json::array();
    for (int i = 0; i < 3; ++i) {
      rows.push_back(Json::array({axes(i, 0), axes(i, 1), axes(i, 2), centre[i]}));
    }
    rows.push_back(Json::array({0.0, 0.0, 0.0, 1.0}));
    Json frame = {{"file_path", shot.image}, {"transform_matrix", rows}, {"fl_x", camera.fx},
                  {"fl_y", camera.fy},       {"cx", camera.cx},          {"cy", camera.cy},
                  {"w", camera.width},       {"h", camera.height}};
    if (shot.camera < set.lenses.size() && !set.lenses[shot.camera].none()) {
      const Distortion& lens = set.lenses[shot.camera];
      frame["camera_model"] = "OPENCV";
      frame.update(
          {{"k1", lens.k1}, {"k2", lens.k2}, {"k3", lens.k3}, {"p1", lens.p1}, {"p2", lens.p2}});
    }
    if (!shot.mask.empty()) frame["mask_path"] = shot.mask;
    if (shot.time) frame["time"] = *shot.time;
    frames.push_back(std::move(frame));
  }
  return Json({{"frames", frames}}).dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

splat::Camera moved(const splat::Camera& camera, const Eigen::Matrix4d& matrix) {
  const Mat3d linear = matrix.topLeftCorner<3, 3>();
  const double determinant = linear.determinant();
  const double scale = determinant > 0.0 ? std::cbrt(determinant) : 0.0;
  const Mat3d turn = linear / scale;
  if (!(scale > 0.0) || !((turn.transpose() * turn - Mat3d::Identity()).norm() < kOrthonormal)) {
    throw_input(
        "a camera can be turned, shifted and scaled, but not sheared or mirrored: give a "
        "transform of these.");
  }
  // A matrix that was typed with a few digits is a rotation only nearly.
  const Mat3d rotation = Eigen::Quaterniond(turn).normalized().toRotationMatrix();
  splat::Camera result = camera;
  result.rotation = camera.rotation * rotation.transpose();
  const Vec3d centre = linear * camera.centre() + matrix.topRightCorner<3, 1>();
  result.translation = -(result.rotation * centre);
  return result;
}

}  // namespace matterfit::capture
