// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/splat.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "capture/carried_splats.hpp"

namespace matterfit::bake {
namespace {

constexpr double kSmallestScale = 1e-9;  // [m]: the file holds its logarithm

/// Shortens the longest axis to `limit` times the second; true if it was longer.
bool clamp_needle(Vec3d& scales, double limit) {
  int longest = 0;
  scales.maxCoeff(&longest);
  const double second = std::max(scales[(longest + 1) % 3], scales[(longest + 2) % 3]);
  if (scales[longest] <= limit * second) return false;
  scales[longest] = limit * second;
  return true;
}

double needle_ratio(Vec3d scales) {
  std::sort(scales.begin(), scales.end());
  return scales[1] > 0.0 ? scales[2] / scales[1] : 1.0;
}

}  // namespace

Ellipsoid transport_covariance(const Mat3d& deformation_gradient, const Mat3d& polar,
                               const Mat3d& rotation, const Vec3d& scales) {
  // Σ' = M Mᵀ with M = F R₀ S₀. B = Mᵀ Q; right rotations that make B's columns orthogonal make Q's
  // columns the principal axes and B's column lengths the scales (Hestenes 1958). Q₀ = R R₀ is the
  // answer for rotations, and near it for everything else.
  const Mat3d m = deformation_gradient * rotation * scales.asDiagonal();
  Ellipsoid result{polar * rotation, scales};
  Mat3d b = m.transpose() * result.rotation;
  for (int sweep = 0; sweep < 30; ++sweep) {
    bool turned = false;
    for (int i = 0; i < 2; ++i) {
      for (int j = i + 1; j < 3; ++j) {
        const double aii = b.col(i).squaredNorm();
        const double ajj = b.col(j).squaredNorm();
        const double aij = b.col(i).dot(b.col(j));
        if (std::abs(aij) <= 1e-14 * std::sqrt(aii * ajj) || aij == 0.0) continue;
        turned = true;
        // The smaller of the two angles, so that axes keep their places.
        const double zeta = (ajj - aii) / (2.0 * aij);
        const double t = std::copysign(1.0, zeta) / (std::abs(zeta) + std::sqrt(1.0 + zeta * zeta));
        const double c = 1.0 / std::sqrt(1.0 + t * t);
        const double s = c * t;
        const Vec3d bi = b.col(i);
        b.col(i) = c * bi - s * b.col(j);
        b.col(j) = s * bi + c * b.col(j);
        const Vec3d qi = result.rotation.col(i);
        result.rotation.col(i) = c * qi - s * result.rotation.col(j);
        result.rotation.col(j) = s * qi + c * result.rotation.col(j);
      }
    }
    if (!turned) break;
  }
  for (int k = 0; k < 3; ++k) result.scales[k] = b.col(k).norm();
  return result;
}

capture::Splats transport(const capture::Splats& rest, const capture::MeshBinding& binding,
                          const capture::ParticleView& state, const SplatOptions& options,
                          Arena& arena, SplatReport* report) {
  const std::size_t count = rest.size();
  if (binding.points() != count) {
    throw_input(std::to_string(count) + " splats, but " + std::to_string(binding.points()) +
                " points are bound.");
  }
  if (rest.sh_degree < 0 || rest.sh_degree > splat::kMaxShDegree ||
      rest.rotations.size() != count || rest.scales.size() != count ||
      rest.sh.size() != 3 * count * rest.sh_bands()) {
    throw_input("the splats' rotations, scales and spherical harmonics are not one each.");
  }
  if (!(options.needle_ratio >= 1.0)) {
    throw_input("the needle ratio is " + std::to_string(options.needle_ratio) +
                ", expected 1 or more.");
  }
  const auto means = binding.positions(state, arena);
  const auto gradients = binding.deformation_gradients(state, arena);
  capture::Splats moved = rest;
  moved.isotropic = false;
  std::vector<std::uint8_t> needles(count, 0);
  arena.parallel_for(0, count, 64, [&](std::size_t i) {
    const Mat3d polar = capture::polar_rotation(gradients[i]);
    const Ellipsoid ellipsoid = transport_covariance(
        gradients[i], polar, rest.rotations[i].cast<double>().toRotationMatrix(),
        rest.scales[i].cast<double>());
    Vec3d scales = ellipsoid.scales;
    const double limit =
        std::max(options.needle_ratio, 1.001 * needle_ratio(rest.scales[i].cast<double>()));
    needles[i] = clamp_needle(scales, limit) ? 1 : 0;
    moved.means[i] = means[i].cast<float>();
    moved.scales[i] = scales.cwiseMax(kSmallestScale).cast<float>();
    Eigen::Quaterniond rotation(ellipsoid.rotation);
    rotation.normalize();
    if (rotation.w() < 0.0) rotation.coeffs() = -rotation.coeffs();
    moved.rotations[i] = rotation.cast<float>();
    if (rest.sh_degree > 0) {
      const std::size_t stride = 3 * rest.sh_bands();
      capture::carry_colours({moved.sh.data() + i * stride, stride}, rest.sh_degree, polar);
    }
  });
  if (report != nullptr) {
    report->needles = static_cast<std::size_t>(std::count(needles.begin(), needles.end(), 1));
  }
  return moved;
}

SplatReport write_splat_frame(const std::filesystem::path& path, const capture::Splats& rest,
                              const capture::MeshBinding& binding,
                              const capture::ParticleView& state, const SplatOptions& options,
                              Arena& arena) {
  SplatReport report;
  capture::write_splats(path, transport(rest, binding, state, options, arena, &report));
  return report;
}

}  // namespace matterfit::bake
