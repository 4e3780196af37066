// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/colmap.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "capture/byte_reader.hpp"
#include "capture/camera_shots.hpp"
#include "capture/png.hpp"

namespace matterfit::capture {
namespace {

constexpr std::size_t kBytesOfAPoint = 24;

enum class Kind { kSimplePinhole, kPinhole, kSimpleRadial, kRadial, kOpenCv, kFullOpenCv, kNone };

/// Models by COLMAP's numbers (src/colmap/sensor/models.h).
struct Model {
  int number;
  std::string_view name;
  std::size_t parameters;
  Kind kind;
};
constexpr std::array<Model, 12> kModels{{
    {0, "SIMPLE_PINHOLE", 3, Kind::kSimplePinhole},
    {1, "PINHOLE", 4, Kind::kPinhole},
    {2, "SIMPLE_RADIAL", 4, Kind::kSimpleRadial},
    {3, "RADIAL", 5, Kind::kRadial},
    {4, "OPENCV", 8, Kind::kOpenCv},
    {5, "OPENCV_FISHEYE", 8, Kind::kNone},
    {6, "FULL_OPENCV", 12, Kind::kFullOpenCv},
    {7, "FOV", 5, Kind::kNone},
    {8, "SIMPLE_RADIAL_FISHEYE", 4, Kind::kNone},
    {9, "RADIAL_FISHEYE", 5, Kind::kNone},
    {10, "THIN_PRISM_FISHEYE", 12, Kind::kNone},
    {11, "RAD_TAN_THIN_PRISM_FISHEYE", 16, Kind::kNone},
}};

[[noreturn]] void refuse_model(const std::string& where, const std::string& model) {
  throw_input(where + " is of the model " + model +
              ", which is not read; SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL and OPENCV are. "
              "Undistort the images first, as `colmap image_undistorter` does.");
}

/// A camera without its pose.
struct Lens {
  splat::Camera camera;
  Distortion distortion;
};

struct Image {
  std::string name;
  std::string where;  ///< in its file, for messages
  std::uint32_t camera = 0;
  std::array<double, 4> turn{};  ///< quaternion, w first
  Vec3d shift = Vec3d::Zero();
};

Lens lens_of(const Model& model, double width, double height, const std::vector<double>& given,
             const std::string& where) {
  for (const double edge : {width, height}) {
    if (!(edge >= 1.0) || edge > kMostImageEdge || edge != std::floor(edge)) {
      throw_input(where + " has an image size of " + std::to_string(edge) + " pixels.");
    }
  }
  if (given.size() != model.parameters) {
    throw_input(where + " has " + std::to_string(given.size()) + " parameters, " +
                std::string(model.name) + " has " + std::to_string(model.parameters) + ".");
  }
  for (const double value : given) {
    if (!std::isfinite(value)) throw_input(where + " has a parameter that is not finite.");
  }
  const bool one_focal = model.kind == Kind::kSimplePinhole || model.kind == Kind::kSimpleRadial ||
                         model.kind == Kind::kRadial;
  std::size_t at = 0;
  Lens lens;
  lens.camera.width = static_cast<int>(width);
  lens.camera.height = static_cast<int>(height);
  lens.camera.fx = given[at++];
  lens.camera.fy = one_focal ? lens.camera.fx : given[at++];
  lens.camera.cx = given[at++];
  lens.camera.cy = given[at++];
  Distortion& distortion = lens.distortion;
  const double* rest = given.data() + at;
  if (model.kind == Kind::kSimpleRadial) distortion.k1 = rest[0];
  if (model.kind == Kind::kRadial) {
    distortion.k1 = rest[0];
    distortion.k2 = rest[1];
  }
  if (model.kind == Kind::kOpenCv || model.kind == Kind::kFullOpenCv) {
    distortion.k1 = rest[0];
    distortion.k2 = rest[1];
    distortion.p1 = rest[2];
    distortion.p2 = rest[3];
  }
  if (model.kind == Kind::kFullOpenCv) {
    distortion.k3 = rest[4];
    if (rest[5] != 0.0 || rest[6] != 0.0 || rest[7] != 0.0) {
      refuse_model(where, "FULL_OPENCV with k4, k5 or k6");
    }
  }
  return lens;
}

CameraSet joined(const std::map<std::uint32_t, Lens>& lenses, std::vector<Image> images,
                 const std::string& folder, const std::string& file) {
  if (images.empty()) throw_input(file + ": its cameras have no images.");
  std::sort(images.begin(), images.end(),
            [](const Image& a, const Image& b) { return a.name < b.name; });
  CameraSet set;
  std::set<std::uint32_t> used;
  set.source = folder;
  set.shots.reserve(images.size());
  for (const Image& image : images) {
    const std::string where = image.where + " '" + image.name + "'";
    const auto lens = lenses.find(image.camera);
    if (lens == lenses.end()) {
      throw_input(where + " is of camera " + std::to_string(image.camera) +
                  ", which the cameras' file does not have. Are both files of one model?");
    }
    const Quatd turn(image.turn[0], image.turn[1], image.turn[2], image.turn[3]);
    if (!(turn.norm() > 0.0) || !std::isfinite(turn.norm()) || !image.shift.allFinite()) {
      throw_input(where + " has a pose that is none: its quaternion or shift is 0 or not finite.");
    }
    splat::Camera camera = lens->second.camera;
    camera.rotation = turn.normalized().toRotationMatrix();
    camera.translation = image.shift;
    Shot shot;
    shot.image = image.name;
    shot.number = last_digits(image.name);
    add_shot(set, std::move(shot), camera, lens->second.distortion, where);
    used.insert(image.camera);
  }
  std::string unused;
  for (const auto& [number, lens] : lenses) {
    if (used.contains(number)) continue;
    unused += (unused.empty() ? "" : ", ") + std::to_string(number);
  }
  if (!unused.empty()) {
    set.notes.push_back(
        folder + ": cameras without an image are left out, by the model's numbers: " + unused +
        ".");
  }
  return set;
}

/// Text, a line after another, with their numbers.
class Lines {
 public:
  Lines(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {}

  bool next(std::string_view& line) {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    line = text_.substr(at_, end - at_);
    if (line.ends_with('\r')) line.remove_suffix(1);
    at_ = end + 1;
    ++number_;
    return true;
  }
  /// The next line that is neither empty nor a comment.
  bool next_entry(std::string_view& line) {
    while (next(line)) {
      const std::size_t begin = line.find_first_not_of(" \t");
      if (begin == std::string_view::npos || line[begin] == '#') continue;
      line.remove_prefix(begin);
      return true;
    }
    return false;
  }
  [[nodiscard]] std::string where() const { return name_ + ": line " + std::to_string(number_); }

 private:
  std::string_view text_;
  std::string name_;
  std::size_t at_ = 0;
  std::size_t number_ = 0;
};

/// Takes the first word off a line; empty at its end.
std::string_view take_word(std::string_view& line) {
  const std::size_t begin = std::min(line.find_first_not_of(" \t"), line.size());
  const std::size_t end = std::min(line.find_first_of(" \t", begin), line.size());
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

template <class Number>
Number number_of(std::string_view word, const std::string& where, const char* what) {
  Number value{};
  const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (code != std::errc() || end != word.data() + word.size()) {
    throw_input(where + ": " + what + " is '" + std::string(word.substr(0, 40)) +
                "', not a number. Is it a file of COLMAP's text format?");
  }
  return value;
}

template <class Table, class Value>
void keep(Table& lenses, std::uint32_t number, Value lens, const std::string& where) {
  if (!lenses.emplace(number, std::move(lens)).second) {
    throw_input(where + " has the number of an earlier camera.");
  }
}

std::string name_of(const std::string& folder, const char* file) { return folder + "/" + file; }

}  // namespace

CameraSet parse_colmap_text(std::string_view cameras, std::string_view images,
                            const std::string& folder) {
  std::map<std::uint32_t, Lens> lenses;
  Lines camera_lines(cameras, name_of(folder, "cameras.txt"));
  std::string_view line;
  while (camera_lines.next_entry(line)) {
    const std::string at = camera_lines.where();
    const auto number = number_of<std::uint32_t>(take_word(line), at, "the camera's number");
    const std::string where = at + ": camera " + std::to_string(number);
    const std::string_view name = take_word(line);
    const auto* model = std::find_if(kModels.begin(), kModels.end(),
                                     [&](const Model& m) { return m.name == name; });
    if (model == kModels.end() || model->kind == Kind::kNone) {
      refuse_model(where, "'" + std::string(name.substr(0, 40)) + "'");
    }
    const auto width = number_of<double>(take_word(line), at, "the width");
    const auto height = number_of<double>(take_word(line), at, "the height");
    std::vector<double> given;
    for (std::string_view word = take_word(line); !word.empty(); word = take_word(line)) {
      given.push_back(number_of<double>(word, at, "a parameter"));
    }
    keep(lenses, number, lens_of(*model, width, height, given, where), where);
  }
  std::vector<Image> found;
  const std::string file = name_of(folder, "images.txt");
  Lines image_lines(images, file);
  while (image_lines.next_entry(line)) {
    Image image;
    image.where = image_lines.where() + ": image";
    const std::string at = image_lines.where();
    (void)number_of<std::uint32_t>(take_word(line), at, "the image's number");
    for (double& part : image.turn) part = number_of<double>(take_word(line), at, "a quaternion");
    for (double& part : image.shift) part = number_of<double>(take_word(line), at, "a shift");
    image.camera = number_of<std::uint32_t>(take_word(line), at, "the camera's number");
    const std::size_t begin = line.find_first_not_of(" \t");
    if (begin == std::string_view::npos) throw_input(at + ": the image has no name.");
    const std::size_t end = line.find_last_not_of(" \t");
    image.name = std::string(line.substr(begin, end + 1 - begin));
    found.push_back(std::move(image));
    if (found.size() > kMostImages) throw_input(file + ": has more than a million images.");
    (void)image_lines.next(line);  // its points, which may be none
  }
  return joined(lenses, std::move(found), folder, file);
}

CameraSet parse_colmap_binary(std::span<const std::byte> cameras, std::span<const std::byte> images,
                              const std::string& folder) {
  std::map<std::uint32_t, Lens> lenses;
  ByteReader camera_reader(cameras, name_of(folder, "cameras.bin"));
  const auto camera_count = camera_reader.read<std::uint64_t>("the number of cameras");
  for (std::uint64_t k = 0; k < camera_count; ++k) {
    const auto number = camera_reader.read<std::uint32_t>("a camera's number");
    const auto model_number = camera_reader.read<std::int32_t>("a camera's model");
    const std::string where = name_of(folder, "cameras.bin") + ": camera " + std::to_string(number);
    const auto* model = std::find_if(kModels.begin(), kModels.end(),
                                     [&](const Model& m) { return m.number == model_number; });
    if (model == kModels.end()) refuse_model(where, "number " + std::to_string(model_number));
    if (model->kind == Kind::kNone) refuse_model(where, std::string(model->name));
    const auto width = double(camera_reader.read<std::uint64_t>("a camera's width"));
    const auto height = double(camera_reader.read<std::uint64_t>("a camera's height"));
    std::vector<double> given(model->parameters);
    for (double& value : given) value = camera_reader.read<double>("a camera's parameters");
    keep(lenses, number, lens_of(*model, width, height, given, where), where);
  }
  std::vector<Image> found;
  const std::string file = name_of(folder, "images.bin");
  ByteReader reader(images, file);
  const auto count = reader.read<std::uint64_t>("the number of images");
  if (count > kMostImages) throw_input(file + ": has more than a million images.");
  for (std::uint64_t k = 0; k < count; ++k) {
    Image image;
    image.where = file + ": image";
    (void)reader.read<std::uint32_t>("an image's number");
    for (double& part : image.turn) part = reader.read<double>("an image's quaternion");
    for (double& part : image.shift) part = reader.read<double>("an image's shift");
    image.camera = reader.read<std::uint32_t>("an image's camera");
    for (char c = reader.read<char>("an image's name"); c != '\0';
         c = reader.read<char>("an image's name")) {
      image.name.push_back(c);
    }
    if (image.name.empty()) reader.fail("an image has no name.");
    const auto points = reader.read<std::uint64_t>("the number of an image's points");
    if (points > reader.remaining() / kBytesOfAPoint) {
      reader.fail("an image's " + std::to_string(points) +
                  " points do not fit into what follows. Is it truncated?");
    }
    (void)reader.take(points * kBytesOfAPoint, "an image's points");
    found.push_back(std::move(image));
  }
  return joined(lenses, std::move(found), folder, file);
}

}  // namespace matterfit::capture
