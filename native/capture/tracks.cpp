// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/tracks.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "capture/c3d.hpp"
#include "capture/npz.hpp"
#include "capture/pc2.hpp"
#include "capture/ply.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;

const Vec3d kMissing = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());

/// Tracks in the file's own units and axes, with what the file says about those.
struct RawTracks {
  Tracks tracks;
  double unit = 1.0;
  char up = 'z';
};

std::string extension_of(const fs::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return extension;
}

double require_fps(const TracksOptions& options, const std::string& name) {
  if (!(options.fps > 0.0) || !std::isfinite(options.fps)) {
    throw_input(name + ": has no times of its own. Give the frames per second it was taken at.");
  }
  return options.fps;
}

std::vector<double> times_from_numbers(const std::vector<std::int64_t>& numbers,
                                       const TracksOptions& options, const std::string& name) {
  if (numbers.size() == 1) return {0.0};
  const double fps = require_fps(options, name);
  std::vector<double> times;
  times.reserve(numbers.size());
  for (const std::int64_t number : numbers) {
    times.push_back(static_cast<double>(number - numbers[0]) / fps);
  }
  return times;
}

void require_length(const Array& array, std::size_t length, const std::string& what) {
  if (array.shape.size() != 1 || array.shape[0] != length) {
    throw_input(what + " has shape " + array.shape_text() + ", expected (" +
                std::to_string(length) + ",).");
  }
}

std::vector<double> read_times(const Arrays& arrays, std::size_t frames,
                               const TracksOptions& options, const std::string& name) {
  if (const auto found = arrays.find("times"); found != arrays.end()) {
    require_length(found->second, frames, name + ": 'times'");
    return found->second.doubles(name + ": 'times'");
  }
  std::vector<std::int64_t> numbers(frames);
  for (std::size_t i = 0; i < frames; ++i) numbers[i] = static_cast<std::int64_t>(i);
  return times_from_numbers(numbers, options, name);
}

char read_up(const Arrays& arrays, const std::string& name) {
  const auto found = arrays.find("up");
  if (found == arrays.end()) return 'z';
  const auto& texts = found->second.texts(name + ": 'up'");
  if (texts.size() != 1 || texts[0].size() != 1) {
    throw_input(name + ": 'up' must be one of x, y, z.");
  }
  const char axis = texts[0][0];
  return axis >= 'X' && axis <= 'Z' ? static_cast<char>(axis - 'X' + 'x') : axis;
}

RawTracks from_arrays(const Arrays& arrays, const TracksOptions& options, const std::string& name) {
  const Array& positions = require(arrays, "positions", name);
  if (positions.shape.size() != 3 || positions.shape[2] != 3) {
    throw_input(name + ": 'positions' has shape " + positions.shape_text() +
                ", expected (frames, points, 3). Was it saved without reshape?");
  }
  RawTracks raw;
  Tracks& tracks = raw.tracks;
  const std::size_t frames = positions.shape[0];
  tracks.points = positions.shape[1];
  if (frames == 0 || tracks.points == 0) {
    throw_input(name + ": 'positions' has shape " + positions.shape_text() + ", which is empty.");
  }
  tracks.times = read_times(arrays, frames, options, name);
  const std::vector<double> values = positions.doubles(name + ": 'positions'");
  tracks.positions.resize(frames * tracks.points);
  for (std::size_t i = 0; i < tracks.positions.size(); ++i) {
    tracks.positions[i] = Vec3d(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
  }
  if (const auto found = arrays.find("visible"); found != arrays.end()) {
    const Array& visible = found->second;
    if (visible.shape != std::vector<std::size_t>{frames, tracks.points}) {
      throw_input(name + ": 'visible' has shape " + visible.shape_text() + ", expected (" +
                  std::to_string(frames) + ", " + std::to_string(tracks.points) + ").");
    }
    for (const std::int64_t seen : visible.integers(name + ": 'visible'")) {
      tracks.visible.push_back(seen != 0 ? 1 : 0);
    }
  }
  if (const auto found = arrays.find("noise"); found != arrays.end()) {
    tracks.noise = found->second.doubles(name + ": 'noise'");
    if (tracks.noise.size() != 1) require_length(found->second, tracks.points, name + ": 'noise'");
  }
  if (const auto found = arrays.find("labels"); found != arrays.end()) {
    require_length(found->second, tracks.points, name + ": 'labels'");
    tracks.labels = found->second.texts(name + ": 'labels'");
  }
  raw.up = read_up(arrays, name);
  return raw;
}

RawTracks from_c3d(const fs::path& path, const TracksOptions& options, const std::string& name) {
  C3d file = read_c3d(path);
  RawTracks raw;
  raw.unit = file.metres_per_unit();
  if (raw.unit == 0.0 && options.unit == 0.0) {
    throw_input(name + ": its unit of length (POINT:UNITS) is '" + file.units +
                "'. Say what it is, mostly mm or m.");
  }
  const double rate = file.rate > 0.0 ? file.rate : require_fps(options, name);
  raw.tracks.points = file.points;
  for (std::size_t i = 0; i < file.frames; ++i) {
    raw.tracks.times.push_back(static_cast<double>(i) / rate);
  }
  raw.tracks.positions = std::move(file.positions);
  raw.tracks.visible = std::move(file.visible);
  raw.tracks.labels = std::move(file.labels);
  return raw;
}

RawTracks from_pc2(const fs::path& path, const TracksOptions& options, const std::string& name) {
  const PointCache cache = read_pc2(path);
  RawTracks raw;
  raw.tracks.points = cache.points;
  const double fps = cache.samples > 1 ? require_fps(options, name) : 1.0;
  for (std::size_t i = 0; i < cache.samples; ++i) {
    raw.tracks.times.push_back(static_cast<double>(i) * double{cache.sample_rate} / fps);
  }
  for (std::size_t i = 0; i < cache.positions.size(); i += 3) {
    raw.tracks.positions.emplace_back(cache.positions[i], cache.positions[i + 1],
                                      cache.positions[i + 2]);
  }
  return raw;
}

Points read_cloud(const fs::path& path) {
  const std::string name = path.filename().string();
  const std::vector<double> values = ply_positions(read_ply(path), name);
  Points points(values.size() / 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i] = Vec3d(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
  }
  return points;
}

RawTracks from_ply(const fs::path& path, const TracksOptions& options, const std::string& name) {
  const NumberedFiles files = find_sequence(path);
  RawTracks raw;
  raw.tracks.times = times_from_numbers(files.numbers, options, name);
  std::vector<Points> clouds;
  for (std::size_t i = 0; i < files.paths.size(); ++i) {
    const Points& cloud = clouds.emplace_back(read_cloud(files.paths[i]));
    raw.tracks.points = std::max(raw.tracks.points, cloud.size());
    if (!options.clouds && (cloud.size() != clouds.front().size() || cloud.empty())) {
      throw_input(files.paths[i].filename().string() + ": has " + std::to_string(cloud.size()) +
                  " points, " + files.paths[0].filename().string() + " has " +
                  std::to_string(clouds.front().size()) +
                  ". Tracks need the same points in every frame. A fit takes clouds without "
                  "correspondence with fit.loss \"chamfer\" or \"surface\".");
    }
  }
  for (Points& cloud : clouds) {
    cloud.resize(raw.tracks.points, kMissing);
    raw.tracks.positions.insert(raw.tracks.positions.end(), cloud.begin(), cloud.end());
  }
  return raw;
}

/// Lower case without spaces: "Tip - 1" and "tip-1" are the same marker.
std::string plain(const std::string& label) {
  std::string text;
  for (const char c : label) {
    if (c == ' ') continue;
    text.push_back(c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c);
  }
  return text;
}

std::size_t require_marker(const Tracks& tracks, const std::string& marker,
                           const std::string& name) {
  if (const auto found = find_marker(tracks, marker)) return *found;
  std::string labels;
  for (std::size_t i = 0; i < std::min<std::size_t>(tracks.labels.size(), 20); ++i) {
    if (i > 0) labels += ", ";
    labels += tracks.labels[i];
  }
  throw_input(name + ": has no marker '" + marker + "'; it has " +
              (labels.empty() ? "no names" : labels) + ", indices 0 to " +
              std::to_string(tracks.points - 1) + ".");
}

void keep_markers(Tracks& tracks, const std::vector<std::string>& markers,
                  const std::string& name) {
  if (markers.empty()) return;
  std::vector<std::size_t> kept;
  for (const std::string& marker : markers) {
    const std::size_t index = require_marker(tracks, marker, name);
    if (std::find(kept.begin(), kept.end(), index) != kept.end()) {
      throw_input(
          std::string(name).append(": marker '").append(marker).append("' is named twice."));
    }
    kept.push_back(index);
  }
  Tracks chosen;
  chosen.points = kept.size();
  chosen.times = std::move(tracks.times);
  for (std::size_t frame = 0; frame < chosen.times.size(); ++frame) {
    for (const std::size_t point : kept) {
      chosen.positions.push_back(tracks.positions[frame * tracks.points + point]);
      if (!tracks.visible.empty()) {
        chosen.visible.push_back(tracks.visible[frame * tracks.points + point]);
      }
    }
  }
  for (const std::size_t point : kept) {
    if (!tracks.labels.empty()) chosen.labels.push_back(tracks.labels[point]);
    if (tracks.noise.size() == tracks.points && tracks.points > 1) {
      chosen.noise.push_back(tracks.noise[point]);
    }
  }
  if (chosen.noise.empty() && tracks.noise.size() == 1) chosen.noise = tracks.noise;
  tracks = std::move(chosen);
}

/// Marks what is not seen, and drops `visible` where everything is.
void settle_visibility(Tracks& tracks) {
  const bool given = !tracks.visible.empty();
  if (!given) tracks.visible.assign(tracks.positions.size(), 1);
  bool all = true;
  for (std::size_t i = 0; i < tracks.positions.size(); ++i) {
    if (!given && tracks.positions[i].array().isNaN().any()) tracks.visible[i] = 0;
    if (tracks.visible[i] == 0) {
      tracks.positions[i] = kMissing;
      all = false;
    }
  }
  if (all) tracks.visible.clear();
}

void settle_noise(Tracks& tracks, const TracksOptions& options, double scale,
                  const std::string& name) {
  for (double& noise : tracks.noise) noise *= scale;
  if (!options.noise.empty()) {
    if (options.noise.size() != 1 && options.noise.size() != tracks.points) {
      throw_input(name + ": noise has " + std::to_string(options.noise.size()) +
                  " values, expected one or one for each of " + std::to_string(tracks.points) +
                  " points.");
    }
    tracks.noise = options.noise;
  }
  for (const double noise : tracks.noise) {
    if (!(noise >= 0.0) || !std::isfinite(noise)) {
      throw_input(name + ": noise holds " + std::to_string(noise) +
                  ", expected standard deviations in metres.");
    }
  }
}

Vec3d mapped(const Eigen::Matrix4d& matrix, const Vec3d& x) {
  return matrix.topLeftCorner<3, 3>() * x + matrix.topRightCorner<3, 1>();
}

std::string name_of(const fs::path& path) {
  const fs::path file = path.has_filename() ? path : path.parent_path();
  return file.filename().string();
}

RawTracks read_raw(const fs::path& path, const TracksOptions& options, const std::string& name) {
  const std::string extension = extension_of(path);
  std::error_code code;
  if (extension == ".ply" || fs::is_directory(path, code)) return from_ply(path, options, name);
  if (extension == ".npz" || extension == ".npy") {
    return from_arrays(read_npz(path), options, name);
  }
  if (extension == ".c3d") return from_c3d(path, options, name);
  if (extension == ".pc2") return from_pc2(path, options, name);
  throw_input(name + ": tracks are read from .npz, .npy, .c3d, .pc2 or numbered .ply, not from '" +
              extension + "'.");
}

}  // namespace

std::optional<std::size_t> find_marker(const Tracks& tracks, const std::string& marker) {
  for (const bool exact : {true, false}) {
    for (std::size_t i = 0; i < tracks.labels.size(); ++i) {
      const std::string& label = tracks.labels[i];
      if (exact ? label == marker : plain(label) == plain(marker)) return i;
    }
  }
  const bool number = !marker.empty() && marker.size() <= 9 &&
                      marker.find_first_not_of("0123456789") == std::string::npos;
  if (number && std::stoul(marker) < tracks.points) return std::stoul(marker);
  return std::nullopt;
}

Eigen::Matrix4d tracks_matrix(double unit, char up, const Eigen::Matrix4d& transform) {
  if (!(unit > 0.0) || !std::isfinite(unit)) {
    throw_input("the unit of a capture is " + std::to_string(unit) +
                ", expected metres per unit above 0.");
  }
  Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
  if (up == 'y') {
    turn.topLeftCorner<3, 3>() << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  } else if (up == 'd') {
    turn.topLeftCorner<3, 3>() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  } else if (up == 'x') {
    turn.topLeftCorner<3, 3>() << 0, 0, -1, 0, 1, 0, 1, 0, 0;
  } else if (up != 'z') {
    throw_input("the up axis of a capture is '" + std::string(1, up) + "', expected x, y, z or d.");
  }
  turn.topLeftCorner<3, 3>() *= unit;
  Eigen::Matrix4d matrix = transform * turn;
  const double volume = std::abs(matrix.topLeftCorner<3, 3>().determinant());
  if (!matrix.allFinite() || transform.row(3) != Eigen::RowVector4d(0, 0, 0, 1) ||
      !(volume > 0.0)) {
    throw_input(
        "the transform of a capture must be a regular affine 4 by 4 matrix with last row 0 0 0 1.");
  }
  return matrix;
}

void check_tracks(const Tracks& tracks) {
  const std::string name = tracks.source.empty() ? "capture" : name_of(tracks.source);
  const std::size_t samples = tracks.frames() * tracks.points;
  if (samples == 0) throw_input(name + ": holds no frames or no points.");
  if (tracks.positions.size() != samples ||
      (!tracks.visible.empty() && tracks.visible.size() != samples)) {
    throw_input(name + ": " + std::to_string(tracks.frames()) + " frames of " +
                std::to_string(tracks.points) + " points need " + std::to_string(samples) +
                " positions, there are " + std::to_string(tracks.positions.size()) + ".");
  }
  for (std::size_t i = 0; i < tracks.frames(); ++i) {
    if (!std::isfinite(tracks.times[i])) {
      throw_input(name + ": the time of frame " + std::to_string(i) + " is not finite.");
    }
    if (i > 0 && !(tracks.times[i] > tracks.times[i - 1])) {
      throw_input(name + ": frame " + std::to_string(i) + " is at " +
                  std::to_string(tracks.times[i]) + " s, not after frame " + std::to_string(i - 1) +
                  " at " + std::to_string(tracks.times[i - 1]) +
                  " s. Sort the frames by time and drop doubles.");
    }
  }
  bool any = false;
  for (std::size_t i = 0; i < samples; ++i) {
    if (!tracks.visible.empty() && tracks.visible[i] == 0) continue;
    any = true;
    if (!tracks.positions[i].allFinite()) {
      throw_input(name + ": point " + std::to_string(i % tracks.points) + " at frame " +
                  std::to_string(i / tracks.points) +
                  " is visible but its position is not finite. Mark it as not visible.");
    }
  }
  if (!any) throw_input(name + ": no point is visible in any frame.");
}

Tracks read_tracks(const fs::path& path, const TracksOptions& options) {
  const std::string name = name_of(path);
  RawTracks raw = read_raw(path, options, name);
  Tracks& tracks = raw.tracks;
  tracks.source = path.string();
  settle_visibility(tracks);
  const Eigen::Matrix4d matrix =
      tracks_matrix(options.unit != 0.0 ? options.unit : raw.unit,
                    options.up != 0 ? options.up : raw.up, options.transform);
  for (Vec3d& position : tracks.positions) position = mapped(matrix, position);
  keep_markers(tracks, options.markers, name);
  settle_noise(tracks, options, std::cbrt(std::abs(matrix.topLeftCorner<3, 3>().determinant())),
               name);
  check_tracks(tracks);
  return std::move(raw.tracks);
}

PointCloudSequence read_point_clouds(const fs::path& path, const TracksOptions& options) {
  const std::string name = name_of(path);
  if (!options.markers.empty()) {
    throw_input(name + ": point clouds have no markers to choose from.");
  }
  PointCloudSequence sequence;
  sequence.source = path.string();
  char up = 'z';
  if (extension_of(path) == ".npz") {
    const Arrays arrays = read_npz(path);
    const Array& counts = require(arrays, "counts", name);
    const std::vector<std::int64_t> sizes = counts.integers(name + ": 'counts'");
    const Array& points = require(arrays, "points", name);
    if (points.shape.size() != 2 || points.shape[1] != 3) {
      throw_input(name + ": 'points' has shape " + points.shape_text() + ", expected (points, 3).");
    }
    const std::vector<double> values = points.doubles(name + ": 'points'");
    std::size_t next = 0;
    for (const std::int64_t size : sizes) {
      if (size < 0 || static_cast<std::uint64_t>(size) > points.shape[0] - next) {
        throw_input(name + ": 'counts' do not add up to the " + std::to_string(points.shape[0]) +
                    " rows of 'points'.");
      }
      Points& cloud = sequence.frames.emplace_back();
      for (std::int64_t i = 0; i < size; ++i, ++next) {
        cloud.emplace_back(values[3 * next], values[3 * next + 1], values[3 * next + 2]);
      }
    }
    if (next != points.shape[0]) {
      throw_input(name + ": 'counts' add up to " + std::to_string(next) + " of " +
                  std::to_string(points.shape[0]) + " rows of 'points'.");
    }
    sequence.times = read_times(arrays, sizes.size(), options, name);
    up = read_up(arrays, name);
  } else {
    const NumberedFiles files = find_sequence(path);
    sequence.times = times_from_numbers(files.numbers, options, name);
    for (const fs::path& file : files.paths) sequence.frames.push_back(read_cloud(file));
  }
  const Eigen::Matrix4d matrix =
      tracks_matrix(options.unit != 0.0 ? options.unit : 1.0, options.up != 0 ? options.up : up,
                    options.transform);
  for (std::size_t frame = 0; frame < sequence.frames.size(); ++frame) {
    if (frame > 0 && !(sequence.times[frame] > sequence.times[frame - 1])) {
      throw_input(name + ": frame " + std::to_string(frame) +
                  " is not later than the one before it.");
    }
    for (Vec3d& point : sequence.frames[frame]) {
      point = mapped(matrix, point);
      if (!point.allFinite()) {
        throw_input(name + ": frame " + std::to_string(frame) +
                    " holds a point that is not finite.");
      }
    }
  }
  if (sequence.frames.empty()) throw_input(name + ": holds no frames.");
  Tracks noise;
  noise.points = 1;
  settle_noise(noise, options, 1.0, name);
  if (!noise.noise.empty()) sequence.noise = noise.noise[0];
  return sequence;
}

}  // namespace matterfit::capture
