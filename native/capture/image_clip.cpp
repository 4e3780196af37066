// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/image_clip.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "base/error.hpp"
#include "base/interrupter.hpp"
#include "capture/image_file.hpp"
#include "capture/lens.hpp"
#include "capture/srgb.hpp"
#include "capture/tracks.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;

constexpr double kSameTime = 1e-6;  // [s]

/// Times at `fps` in the order of `times`. Cameras need not agree to the last digit: what is nearer
/// than half of the shortest step of one camera is one time.
std::vector<double> ranked(const CameraSet& set, const std::vector<double>& times, double fps) {
  std::map<std::size_t, std::set<double>> of_camera;
  for (std::size_t i = 0; i < times.size(); ++i) of_camera[set.shots[i].camera].insert(times[i]);
  double step = std::numeric_limits<double>::infinity();
  for (const auto& [camera, own] : of_camera) {
    for (auto next = own.begin(); next != own.end() && std::next(next) != own.end(); ++next) {
      step = std::min(step, *std::next(next) - *next);
    }
  }
  if (!std::isfinite(step)) step = 2.0 * kSameTime;  // an image a camera
  std::map<double, double> rank;
  for (const double time : times) rank[time] = 0.0;
  double last = rank.begin()->first;
  double number = 0.0;
  for (auto& [time, at] : rank) {
    if (time - last > 0.5 * step) {
      number += 1.0;
      last = time;
    }
    at = number / fps;
  }
  std::vector<double> result;
  result.reserve(times.size());
  for (const double time : times) result.push_back(rank.at(time));
  return result;
}

/// The time of each shot, in the file's order.
std::vector<double> times_of(const CameraSet& set, const ImageClipOptions& options) {
  std::vector<double> times;
  times.reserve(set.shots.size());
  bool timed = true;
  for (const Shot& shot : set.shots) timed = timed && shot.time.has_value();
  for (const Shot& shot : set.shots) {
    if (!timed && !shot.number) {
      throw_input(set.source + ": image '" + shot.image +
                  "' has neither a 'time' nor a number at the end of its name.");
    }
    times.push_back(timed ? *shot.time : *shot.number);
  }
  if (timed && options.fps == 0.0) return times;
  const double fps = options.fps > 0.0 ? options.fps : options.default_fps;
  if (!timed) {
    const double first = *std::min_element(times.begin(), times.end());
    for (double& time : times) time = (time - first) / fps;
    return times;
  }
  return ranked(set, times, fps);
}

std::vector<double> distinct_times(std::vector<double> times) {
  std::sort(times.begin(), times.end());
  std::vector<double> kept;
  for (const double time : times) {
    if (kept.empty() || time > kept.back() + kSameTime) kept.push_back(time);
  }
  return kept;
}

void check_size(const Bitmap& bitmap, const splat::Camera& camera, const fs::path& file) {
  if (bitmap.width == camera.width && bitmap.height == camera.height) return;
  throw_input(file.string() + ": is " + std::to_string(bitmap.width) + " × " +
              std::to_string(bitmap.height) + " pixels, its camera's images are " +
              std::to_string(camera.width) + " × " + std::to_string(camera.height) +
              ". Scale the image, or the camera's lens with its size.");
}

/// Alpha where there is some, else brightness: mattes are white on black. What was light is taken
/// as light, so that a pixel that is covered by half is a half.
std::vector<std::uint8_t> coverage(const Bitmap& bitmap) {
  std::vector<std::uint8_t> matte(bitmap.pixels());
  for (std::size_t i = 0; i < matte.size(); ++i) {
    const std::uint8_t* rgba = bitmap.rgba.data() + 4 * i;
    const int grey = (rgba[0] + rgba[1] + rgba[2]) / 3;
    const int value = bitmap.has_alpha   ? rgba[3]
                      : bitmap.was_light ? int(std::lround(255.0F * linear_of_bytes()[grey]))
                                         : grey;
    matte[i] = static_cast<std::uint8_t>(value);
  }
  return matte;
}

/// The files of `count` cameras' plates.
std::vector<fs::path> plate_files(const ClipPlates& plates, std::size_t count) {
  const std::string given = plates.files.size() == 1 ? plates.files.front().string() : "";
  const std::size_t last = given.rfind('#');
  if (last == std::string::npos) {
    if (plates.files.size() == count) return plates.files;
    throw_input("plate: there are " + std::to_string(plates.files.size()) + " clean plates and " +
                std::to_string(count) +
                " cameras. Give a file for each, in their order, or a name with # for a camera's "
                "number.");
  }
  const std::size_t before = given.find_last_not_of('#', last);
  const std::size_t begin = before == std::string::npos ? 0 : before + 1;
  std::vector<fs::path> files;
  for (std::size_t k = 0; k < count; ++k) {
    std::string number = std::to_string(k);
    const std::size_t width = last + 1 - begin;
    if (number.size() < width) number.insert(0, width - number.size(), '0');
    files.emplace_back(given.substr(0, begin) + number + given.substr(last + 1));
  }
  return files;
}

std::vector<CleanPlate> read_plates(const ImageClipOptions& options, const CameraSet& set) {
  std::vector<CleanPlate> plates;
  if (!options.plates) return plates;
  const std::vector<fs::path> files = plate_files(*options.plates, set.cameras.size());
  for (std::size_t k = 0; k < files.size(); ++k) {
    const Bitmap bitmap = read_image(files[k]);
    check_size(bitmap, set.cameras[k], files[k]);
    plates.emplace_back(bitmap, options.plates->threshold);
  }
  return plates;
}

Bitmap read_sized(const fs::path& file, const splat::Camera& camera) {
  Bitmap bitmap = read_image(file);
  check_size(bitmap, camera, file);
  return bitmap;
}

std::array<std::vector<std::uint8_t>, 3> planes(const Bitmap& bitmap) {
  std::array<std::vector<std::uint8_t>, 3> colours;
  for (std::size_t c = 0; c < 3; ++c) {
    colours[c].reserve(bitmap.pixels());
    for (std::size_t i = 0; i < bitmap.pixels(); ++i) {
      colours[c].push_back(bitmap.rgba[4 * i + c]);
    }
  }
  return colours;
}

/// Whether a file of its own is an image's matte.
bool has_own_matte(const Shot& shot, const ImageClipOptions& options) {
  return !options.key && !options.plates && !shot.mask.empty();
}

/// The file that a matte is read or made from.
fs::path matte_source(const CameraSet& set, const Shot& shot, const ImageClipOptions& options) {
  return set.folder / (has_own_matte(shot, options) ? shot.mask : shot.image);
}

/// `colours`: where they go; null: they are not asked for.
BodyMatte read_matte(const CameraSet& set, const Shot& shot, const std::vector<CleanPlate>& plates,
                     const ImageClipOptions& options,
                     std::array<std::vector<std::uint8_t>, 3>* colours) {
  const bool own = has_own_matte(shot, options);
  const splat::Camera& camera = set.cameras[shot.camera];
  const fs::path file = matte_source(set, shot, options);
  const Bitmap bitmap = read_sized(file, camera);
  if (colours != nullptr) {
    *colours = planes(own ? read_sized(set.folder / shot.image, camera) : bitmap);
  }
  if (options.key) return keyed_matte(bitmap, *options.key);
  if (!plates.empty()) return plates[shot.camera].matte(bitmap);
  if (!own && !bitmap.has_alpha) {
    throw_input(
        file.string() +
        ": has no matte: neither an alpha channel nor a 'mask_path' in the cameras' file. "
        "Add one, or give the body's colour as the capture's 'key', or images without the body "
        "as its 'plate'.");
  }
  return {coverage(bitmap)};
}

/// Refuses what cannot be a matte; true where it is empty.
bool is_empty(const std::vector<std::uint8_t>& matte, const std::string& image) {
  const auto [low, high] = std::minmax_element(matte.begin(), matte.end());
  if (*low >= 128) {
    throw_input(image +
                ": its matte covers the whole image, so it shows no outline. Is the alpha channel "
                "filled, or the matte inverted?");
  }
  return *high < 128;
}

std::optional<Undistortion> undistortion_of(const CameraSet& set, std::size_t camera) {
  if (set.lenses[camera].none()) return std::nullopt;
  return Undistortion(set.cameras[camera], set.lenses[camera]);
}

/// Empty where all is seen.
std::vector<std::uint8_t> seen_by(const std::optional<Undistortion>& lens) {
  if (!lens) return {};
  std::vector<std::uint8_t> seen = lens->seen();
  if (std::find(seen.begin(), seen.end(), std::uint8_t{0}) == seen.end()) seen.clear();
  return seen;
}

void state_lens(const ImageClip& clip, std::size_t camera, const std::optional<Undistortion>& lens,
                std::vector<std::string>& statements) {
  if (!lens) return;
  const std::vector<std::uint8_t>& seen = clip.seen[camera];
  const auto blind = std::count(seen.begin(), seen.end(), std::uint8_t{0});
  statements.push_back(fmt::format(
      "Camera {}: its lens is undistorted, by up to {:.1f} pixels{}.", camera, lens->farthest(),
      blind == 0 ? std::string()
                 : fmt::format("; {:.1f} % of its image are not seen by it",
                               100.0 * double(blind) / double(seen.size()))));
}

/// `count`: images of each camera.
void state_missing(const ImageClip& clip, const std::vector<std::size_t>& count,
                   std::vector<std::string>& statements) {
  for (std::size_t k = 0; k < count.size(); ++k) {
    if (count[k] == clip.times.size()) continue;
    statements.push_back(clip.source + ": camera " + std::to_string(k) + " has " +
                         std::to_string(count[k]) + " images of " +
                         std::to_string(clip.times.size()) +
                         " times; no other image stands in for those that are missing.");
  }
}

/// Oddities of a camera's mattes that are said to the user.
struct OddMattes {
  std::size_t empty = 0;
  std::string first_empty;
  double kept = 1.0;  ///< BodyMatte::kept of the image where it is least
  std::string least;
};

void state_mattes(const ImageClip& clip, const std::vector<OddMattes>& odd,
                  const std::vector<std::size_t>& count, const ImageClipOptions& options,
                  std::vector<std::string>& statements) {
  constexpr double kMostlyOthers = 0.5;
  for (std::size_t k = 0; k < odd.size(); ++k) {
    const OddMattes& of = odd[k];
    if (of.empty > 0) {
      statements.push_back(
          fmt::format("{}: camera {}: the mattes of {} of its {} images are empty, {} the first{}",
                      clip.source, k, of.empty, count[k], of.first_empty,
                      of.empty == count[k] ? "." : "; the body is taken to be out of them."));
    }
    if (of.kept < kMostlyOthers) {
      statements.push_back(fmt::format(
          "{}: camera {}: {} several regions, of which the largest is the matte; in {} it is "
          "{:.0f} % of them. Look whether it is the body; {} tells it from the rest.",
          clip.source, k, options.key ? "the key takes" : "what differs from the plate are",
          of.least, 100.0 * of.kept,
          options.key ? "another colour, or a narrower 'range'," : "a higher 'threshold'"));
    }
  }
}

/// Throws Error(kInput) naming the camera whose images are missing, before any is read.
void check_images_are_there(const CameraSet& set, const ImageClipOptions& options) {
  std::vector<std::size_t> missing(set.cameras.size(), 0);
  std::vector<std::size_t> all(set.cameras.size(), 0);
  const Shot* first = nullptr;
  for (const Shot& shot : set.shots) {
    ++all[shot.camera];
    std::error_code code;
    if (fs::exists(matte_source(set, shot, options), code)) continue;
    ++missing[shot.camera];
    if (first == nullptr) first = &shot;
  }
  if (first == nullptr) return;
  const std::size_t camera = first->camera;
  throw_input(set.source + ": " + std::to_string(missing[camera]) + " of the " +
              std::to_string(all[camera]) +
              (has_own_matte(*first, options) ? " mattes" : " images") + " of camera " +
              std::to_string(camera) + " are not there, the first of them '" +
              matte_source(set, *first, options).string() +
              "'. Name the folder that holds the images as the capture's 'images' (Image Folder), "
              "or take the missing ones out of the file.");
}

}  // namespace

std::vector<fs::path> image_clip_files(const fs::path& cameras, const ImageClipOptions& options) {
  const CameraSet set = read_cameras(cameras, options.images);
  std::vector<fs::path> files;
  if (fs::is_directory(cameras)) {
    for (const fs::directory_entry& entry : fs::directory_iterator(cameras)) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
  } else {
    files.push_back(cameras);
  }
  if (options.plates) {
    const std::vector<fs::path> plates = plate_files(*options.plates, set.cameras.size());
    files.insert(files.end(), plates.begin(), plates.end());
  }
  for (const Shot& shot : set.shots) {
    files.push_back(set.folder / shot.image);
    if (!shot.mask.empty()) files.push_back(set.folder / shot.mask);
  }
  std::vector<fs::path> once;
  std::set<fs::path> known;
  for (fs::path& file : files) {
    if (known.insert(file).second) once.push_back(std::move(file));
  }
  return once;
}

ImageClip read_image_clip(const fs::path& cameras, const ImageClipOptions& options,
                          std::vector<std::string>& statements, const SightTaker& take,
                          const Interrupter* interrupter) {
  const CameraSet set = read_cameras(cameras, options.images);
  if (set.folder.empty()) {
    throw_input(set.source + ": its images were not found: '" + set.shots.front().image +
                "' lies neither beside the model nor in a folder 'images' there or up to two "
                "folders above. Name the folder that holds them as the capture's 'images' "
                "(Image Folder).");
  }
  statements.insert(statements.end(), set.notes.begin(), set.notes.end());
  const std::vector<double> times = times_of(set, options);
  ImageClip clip;
  clip.source = cameras.string();
  clip.times = distinct_times(times);
  const Eigen::Matrix4d matrix = tracks_matrix(options.unit, options.up, options.transform);
  clip.cameras.reserve(set.cameras.size());
  const std::vector<CleanPlate> plates = read_plates(options, set);
  std::vector<std::optional<Undistortion>> lenses;
  for (std::size_t k = 0; k < set.cameras.size(); ++k) {
    clip.cameras.push_back(moved(set.cameras[k], matrix));
    lenses.push_back(undistortion_of(set, k));
    clip.seen.push_back(seen_by(lenses.back()));
    state_lens(clip, k, lenses.back(), statements);
  }
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> shots;  // frame, camera
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    const auto after = std::upper_bound(clip.times.begin(), clip.times.end(), times[i]);
    const auto frame = static_cast<std::size_t>(after - clip.times.begin()) - 1;
    const auto [at, added] = shots.emplace(std::pair(frame, set.shots[i].camera), i);
    if (!added) {
      throw_input(clip.source + ": '" + set.shots[at->second].image + "' and '" +
                  set.shots[i].image + "' are of one camera and one time.");
    }
  }
  check_images_are_there(set, options);
  std::size_t empty = 0;
  std::vector<std::size_t> count(clip.cameras.size(), 0);
  std::vector<OddMattes> odd(clip.cameras.size());
  for (const auto& [place, i] : shots) {
    if (interrupter != nullptr) interrupter->check();
    const Shot& shot = set.shots[i];
    Sight sight;
    sight.frame = place.first;
    sight.camera = place.second;
    sight.image = shot.image;
    BodyMatte made =
        read_matte(set, shot, plates, options, options.colours ? &sight.colours : nullptr);
    sight.matte = std::move(made.alpha);
    OddMattes& of_camera = odd[sight.camera];
    if (made.kept < of_camera.kept) {
      of_camera.kept = made.kept;
      of_camera.least = shot.image;
    }
    if (is_empty(sight.matte, shot.image)) {
      ++empty;
      if (of_camera.empty++ == 0) of_camera.first_empty = shot.image;
    }
    const auto& lens = lenses[sight.camera];
    if (lens) {
      sight.matte = lens->resampled(sight.matte);
      for (std::vector<std::uint8_t>& plane : sight.colours) {
        if (!plane.empty()) plane = lens->resampled(plane);
      }
    }
    ++count[sight.camera];
    take(clip, std::move(sight));
  }
  if (empty == shots.size()) {
    throw_input(clip.source + ": all mattes are empty: " +
                (options.key ? "no image has a region of the colour of 'key'. Take the colour from "
                               "the body in an image, or widen 'range'."
                 : !plates.empty()
                     ? "no image differs from its clean plate. Is 'plate' without the "
                       "body, and its 'threshold' not too high?"
                     : "no image shows the body. Are these its mattes, or is the alpha channel "
                       "inverted?"));
  }
  state_mattes(clip, odd, count, options, statements);
  state_missing(clip, count, statements);
  return clip;
}

}  // namespace matterfit::capture
