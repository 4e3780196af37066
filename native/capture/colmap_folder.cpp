// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/camera_shots.hpp"
#include "capture/colmap.hpp"
#include "capture/tracks.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;

/// images.txt holds the points of all images.
constexpr std::uint64_t kMostModelBytes = std::uint64_t{4} << 30U;

bool is_file(const fs::path& path) {
  std::error_code code;
  return fs::is_regular_file(path, code);
}

bool holds(const fs::path& folder, const char* ending) {
  return is_file(folder / (std::string("cameras") + ending)) &&
         is_file(folder / (std::string("images") + ending));
}

/// Where a model's images lie, given one of their names; empty where they were not found.
fs::path folder_of_images(const fs::path& model, const std::string& image) {
  for (const char* place : {".", "images", "../images", "../../images"}) {
    fs::path folder = (model / place).lexically_normal();
    if (is_file(folder / image)) return folder;
  }
  return {};
}

/// The name of an image's matte relative to the images' folder; empty where there is none.
std::string mask_of(const fs::path& folder, const std::string& image) {
  const fs::path masks = fs::path("..") / "masks";
  for (const fs::path& name :
       {masks / (image + ".png"), masks / fs::path(image).replace_extension(".png")}) {
    if (is_file(folder / name)) return name.generic_string();
  }
  return {};
}

/// The name with # in place of the digits at its end; empty where it does not end with digits.
std::string sequence_of(const std::string& image) {
  const fs::path path(image);
  std::string stem = path.stem().string();
  std::size_t digits = 0;
  while (digits < stem.size() &&
         std::isdigit(static_cast<unsigned char>(stem[stem.size() - 1 - digits])) != 0) {
    ++digits;
  }
  if (digits == 0 || stem.find('#') != std::string::npos) return {};
  stem.replace(stem.size() - digits, digits, digits, '#');
  return (path.parent_path() / (stem + path.extension().string())).generic_string();
}

/// Adds the images of a camera's sequence that the model does not name.
void add_unregistered(CameraSet& set) {
  std::map<std::string, std::set<std::size_t>> cameras;  // of each sequence
  std::set<std::string> named;
  for (const Shot& shot : set.shots) {
    cameras[sequence_of(shot.image)].insert(shot.camera);
    named.insert(shot.image);
  }
  std::size_t added = 0;
  for (const auto& [sequence, owners] : cameras) {
    if (sequence.empty() || owners.size() != 1) continue;
    std::error_code code;
    if (!fs::is_directory((set.folder / sequence).parent_path(), code)) continue;
    for (const fs::path& file : find_sequence(set.folder / sequence).paths) {
      Shot shot;
      shot.image = (fs::path(sequence).parent_path() / file.filename()).generic_string();
      if (!named.insert(shot.image).second) continue;
      shot.camera = *owners.begin();
      shot.number = last_digits(shot.image);
      set.shots.push_back(std::move(shot));
      ++added;
    }
  }
  if (added == 0) return;
  set.notes.push_back(std::to_string(added) +
                      " images that the model does not name are of the sequence of one that it "
                      "names; they are taken to be of the same camera, standing still.");
}

std::string_view text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::optional<ColmapPlace> find_colmap(const fs::path& path) {
  std::error_code code;
  if (fs::is_directory(path, code)) {
    for (const char* place : {".", "sparse/0", "sparse"}) {
      const fs::path folder = (path / place).lexically_normal();
      if (holds(folder, ".bin")) return ColmapPlace{folder, true};
      if (holds(folder, ".txt")) return ColmapPlace{folder, false};
    }
    return std::nullopt;
  }
  const std::string stem = path.stem().string();
  const std::string ending = path.extension().string();
  if (stem != "cameras" && stem != "images") return std::nullopt;
  if (ending != ".bin" && ending != ".txt") return std::nullopt;
  return ColmapPlace{path.parent_path(), ending == ".bin"};
}

CameraSet read_colmap(const ColmapPlace& place, const fs::path& images) {
  const fs::path folder = place.folder.empty() ? fs::path(".") : place.folder;
  const char* ending = place.binary ? ".bin" : ".txt";
  const auto cameras = read_file(folder / (std::string("cameras") + ending), kMostModelBytes);
  const auto poses = read_file(folder / (std::string("images") + ending), kMostModelBytes);
  const std::string name = folder.string();
  CameraSet set = place.binary ? parse_colmap_binary(cameras, poses, name)
                               : parse_colmap_text(text_of(cameras), text_of(poses), name);
  set.folder = images.empty() ? folder_of_images(folder, set.shots.front().image) : images;
  if (set.folder.empty()) return set;
  add_unregistered(set);
  for (Shot& shot : set.shots) shot.mask = mask_of(set.folder, shot.image);
  return set;
}

}  // namespace matterfit::capture
