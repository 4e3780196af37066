// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::capture {

/// A capture: how points of a body moved. Metres, seconds, Z up after reading.
struct Tracks {
  std::size_t points = 0;             ///< N
  std::vector<double> times;          ///< (T,) [s], strictly ascending, from the file
  std::vector<Vec3d> positions;       ///< (T, N) frame-major; NaN where not visible
  std::vector<std::uint8_t> visible;  ///< (T, N) or empty: all visible
  std::vector<double> noise;          ///< standard deviation [m]: empty, one, or N values
  std::vector<std::string> labels;    ///< marker names, or empty
  std::string source;                 ///< file it came from

  [[nodiscard]] std::size_t frames() const { return times.size(); }
  [[nodiscard]] const Vec3d& position(std::size_t frame, std::size_t point) const {
    return positions[frame * points + point];
  }
  [[nodiscard]] bool is_visible(std::size_t frame, std::size_t point) const {
    return visible.empty() || visible[frame * points + point] != 0;
  }
};

/// How the numbers of a file become metres, seconds, Z up: x = transform · turn(up) · unit · file.
struct TracksOptions {
  /// Metres per unit of the file; 0: what a C3D file says (one that does not is refused), else 1.
  double unit = 0.0;
  char up = 0;  ///< 'x', 'y' or 'z', or 'd': y points down; 0: what the file says, else 'z'
  /// After unit and up; maps points (last row 0 0 0 1). Velocities and noise follow its scale.
  Eigen::Matrix4d transform = Eigen::Matrix4d::Identity();
  double fps = 0.0;  ///< frames per second of files that have no times (.npy, PLY, PC2)
  /// Names (case and spaces do not matter), or indices as decimal numbers, of the markers to keep,
  /// in this order; empty: all.
  std::vector<std::string> markers;
  std::vector<double> noise;  ///< [m] overrides the file's: one value or one a kept marker
  /// Point i of one frame is not point i of another: PLY files may differ in their number of
  /// points. Those that a frame lacks are not visible in it.
  bool clouds = false;
};

/// Point clouds without correspondence, as many points in each frame as were seen.
struct PointCloudSequence {
  std::vector<double> times;   ///< (T,) [s], strictly ascending
  std::vector<Points> frames;  ///< [m], Z up
  double noise = 0.0;          ///< standard deviation [m]; 0: not known
  std::string source;
};

/// Index of the marker of this name (exactly; else without regard to case and spaces, so that
/// "Tip-1" finds "Tip - 1"), or of this decimal number.
[[nodiscard]] std::optional<std::size_t> find_marker(const Tracks& tracks,
                                                     const std::string& marker);

/// Reads tracks by what `path` is: a .npz (`positions` (T,N,3); `times` (T,); optional `visible`
/// (T,N), `noise` scalar or (N,), `up` "x|y|z", `labels` (N,)), a .npy (positions), a .pc2, a .c3d,
/// or numbered PLY files with one number of points (see TracksOptions::clouds): a pattern
/// `cloud_####.ply`, the first file of the sequence, or its folder. A point whose position is NaN
/// in a file without `visible` is not visible. Result satisfies check_tracks(). Throws
/// Error(kInput).
[[nodiscard]] Tracks read_tracks(const std::filesystem::path& path,
                                 const TracksOptions& options = {});

/// Numbered PLY files (pattern, first file or folder as above), or a .npz of `points` (ΣN,3),
/// `counts` (T,), `times` (T,), as clouds that may differ in their number of points. Markers do not
/// apply and are refused.
[[nodiscard]] PointCloudSequence read_point_clouds(const std::filesystem::path& path,
                                                   const TracksOptions& options = {});

/// A numbered sequence on disk.
struct NumberedFiles {
  std::vector<std::int64_t> numbers;  ///< ascending
  std::vector<std::filesystem::path> paths;
};

/// Files that match a pattern (one run of # in the file's name: as many digits or more), the
/// sequence that an existing file belongs to (same name but for the last digits before the suffix),
/// or the one sequence of .ply in a folder. Throws Error(kInput) if there is none, if two files
/// have one number, or if the folder holds more than one sequence.
[[nodiscard]] NumberedFiles find_sequence(const std::filesystem::path& pattern_or_first);

/// The matrix transform · turn(up) · unit; `up` is 'x', 'y' or 'z' and becomes z by a turn about
/// one axis (y up: about x; x up: about y). Throws Error(kInput) if it is not affine and regular.
[[nodiscard]] Eigen::Matrix4d tracks_matrix(double unit, char up, const Eigen::Matrix4d& transform);

/// Throws Error(kInput), with words that name frame and point, if sizes disagree, times are not
/// finite and strictly ascending, a visible position is not finite, or nothing is visible.
void check_tracks(const Tracks& tracks);

}  // namespace matterfit::capture
