// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/vec.hpp"
#include "splat/gaussians.hpp"

namespace matterfit::capture {

/// A 3D Gaussian Splatting scene (Kerbl et al. 2023), in plain quantities.
struct Splats {
  int sh_degree = 0;                          ///< 0 to 3
  bool isotropic = false;                     ///< the file had scale_0 only
  bool antialiased = false;                   ///< trained so (splat::RenderOptions); SPZ says it
  std::vector<Vec3f> means;                   ///< (N) [m]
  std::vector<Eigen::Quaternionf> rotations;  ///< (N) normalised
  std::vector<Vec3f> scales;                  ///< (N) standard deviations [m] (exp applied)
  std::vector<float> opacities;               ///< (N) in (0, 1) (sigmoid applied)
  /// (N, (degree+1)², 3) real spherical harmonics, coefficient-major: [i][band][rgb];
  /// colour of band 0 alone = 0.5 + 0.28209479 · sh[i][0].
  std::vector<float> sh;

  [[nodiscard]] std::size_t size() const { return means.size(); }
  [[nodiscard]] std::size_t sh_bands() const {
    const auto side = static_cast<std::size_t>(sh_degree) + 1;
    return side * side;
  }
};

/// Reads the PLY that 3DGS trainers write: x y z, f_dc_0..2, f_rest_* channel-major (0, 9, 24 or 45
/// of them), opacity (logit), scale_0..2 or scale_0 (natural log), rot_0..3 (w x y z; absent in
/// isotropic files). Throws Error(kInput) naming property or row and reason.
[[nodiscard]] Splats parse_splats(std::span<const std::byte> bytes, const std::string& name);

/// Any file of splats, by the end of its name: `.splat` (dot_splat.hpp), `.spz` (spz.hpp), else a
/// PLY. Throws Error(kInput) for `.ksplat` and `.sog`, with the name of a converter.
[[nodiscard]] Splats read_splats(const std::filesystem::path& path);

/// Whether read_splats() is for a file: by the end of its name, of a PLY by its header.
[[nodiscard]] bool is_of_splats(const std::filesystem::path& path);

/// The splats whose centres lie in a box, in the file's own frame. Throws Error(kInput), which
/// says where the splats lie, if none lies in it.
[[nodiscard]] Splats cropped(const Splats& splats, const Eigen::AlignedBox3d& box);

/// The splats of at least that opacity. Throws Error(kInput), which says how opaque the splats are,
/// if none is.
[[nodiscard]] Splats opaque(Splats splats, double threshold);

/// The splats of a file that a document keeps: the opaque ones in `crop` (none: everywhere).
[[nodiscard]] Splats chosen(Splats splats, const std::optional<Eigen::AlignedBox3d>& crop,
                            double opacity_threshold);

/// `.splat` where the name ends so, else PLY with the same conventions as read (log, logit,
/// channel-major), binary little endian. Neither has a place for `antialiased`.
void write_splats(const std::filesystem::path& path, const Splats& splats);

/// The same Gaussians as the rasteriser takes them, F left out.
[[nodiscard]] splat::Gaussians gaussians_of(const Splats& splats);

}  // namespace matterfit::capture
