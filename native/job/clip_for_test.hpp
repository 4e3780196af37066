// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "base/file.hpp"
#include "capture/cameras.hpp"
#include "capture/particle_gaussians.hpp"
#include "capture/png.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/state_file.hpp"
#include "splat/rasteriser.hpp"

/// Mattes of simulated bodies, painted by other means than a fit draws them: each particle as a
/// square on the screen, slightly larger than the particle separation.
namespace matterfit::job::fit_test {

inline constexpr int kClipWidth = 120;
inline constexpr int kClipHeight = 90;

/// Stands at `place` and looks at `at`, z up.
inline splat::Camera looking(const Vec3d& place, const Vec3d& at) {
  splat::Camera camera;
  camera.width = kClipWidth;
  camera.height = kClipHeight;
  camera.fx = camera.fy = 1.2 * kClipWidth;
  camera.cx = 0.5 * kClipWidth;
  camera.cy = 0.5 * kClipHeight;
  const Vec3d forward = (at - place).normalized();
  const Vec3d right = forward.cross(Vec3d::UnitZ()).normalized();
  camera.rotation.row(0) = right;
  camera.rotation.row(1) = forward.cross(right);
  camera.rotation.row(2) = forward;
  camera.translation = -(camera.rotation * place);
  return camera;
}

/// The middle of `thrown_cube()` on its way, and two cameras that see it.
inline const Vec3d kFlightMiddle(0.5, 0.3, 0.25);

inline std::vector<splat::Camera> two_cameras() {
  return {looking(Vec3d(0.6, -2.0, 0.9), kFlightMiddle),
          looking(Vec3d(2.5, 0.6, 0.7), kFlightMiddle)};
}

/// The truth at particles that lie elsewhere than the fit's.
inline Json filmed_cube() {
  Json truth = thrown_cube();
  truth["scene"]["particle_separation"] = 0.04;
  return truth;
}

/// The colour of a particle by where it lies at rest.
using Painted = std::function<Vec3d(const Vec3d& rest)>;

/// Coverage of four samples along each edge of a pixel, and the mean colour of what is covered,
/// the nearest particle's (none: black).
inline capture::Bitmap paint(const mpm::Scene& scene, const mpm::FrameState& state,
                             const splat::Camera& camera, const Painted& painted = {}) {
  constexpr int kSamples = 4;
  const int width = kSamples * camera.width;
  const int height = kSamples * camera.height;
  const std::size_t samples = std::size_t(width) * std::size_t(height);
  std::vector<double> depth(samples, std::numeric_limits<double>::infinity());
  std::vector<Vec3d> colours(samples, Vec3d::Zero());
  const double separation = 0.5 * scene.dx;
  for (std::size_t b = 0; b < state.bodies.size(); ++b) {
    for (std::size_t p = 0; p < state.bodies[b].positions.size(); ++p) {
      const Vec3d x = state.bodies[b].positions[p].cast<double>();
      const Vec3d colour = painted ? painted(scene.bodies[b].rest[p]) : Vec3d(Vec3d::Zero());
      const Vec3d t = camera.rotation * x + camera.translation;
      const Eigen::Vector2d middle =
          kSamples * Eigen::Vector2d(camera.fx * t.x() / t.z() + camera.cx,
                                     camera.fy * t.y() / t.z() + camera.cy);
      const double side = kSamples * camera.fx * separation / t.z();
      const auto low = [&](int axis) {
        return std::max(0, int(std::ceil(middle[axis] - 0.55 * side - 0.5)));
      };
      const auto high = [&](int axis, int size) {
        return std::min(size - 1, int(std::floor(middle[axis] + 0.55 * side - 0.5)));
      };
      for (int j = low(1); j <= high(1, height); ++j) {
        for (int i = low(0); i <= high(0, width); ++i) {
          const std::size_t at = std::size_t(j) * std::size_t(width) + std::size_t(i);
          if (!(t.z() < depth[at])) continue;
          depth[at] = t.z();
          colours[at] = colour;
        }
      }
    }
  }
  capture::Bitmap bitmap(camera.width, camera.height);
  bitmap.has_alpha = true;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      int covered = 0;
      Vec3d sum = Vec3d::Zero();
      for (int j = 0; j < kSamples; ++j) {
        for (int i = 0; i < kSamples; ++i) {
          const std::size_t at =
              std::size_t(kSamples * y + j) * std::size_t(width) + std::size_t(kSamples * x + i);
          if (!std::isfinite(depth[at])) continue;
          ++covered;
          sum += colours[at];
        }
      }
      std::uint8_t* rgba = bitmap.rgba.data() + 4 * std::size_t(y * camera.width + x);
      for (int c = 0; c < 3 && covered > 0; ++c) {
        rgba[c] = static_cast<std::uint8_t>(std::lround(255.0 * sum[c] / covered));
      }
      rgba[3] = static_cast<std::uint8_t>(255 * covered / (kSamples * kSamples));
    }
  }
  return bitmap;
}

/// The mask of the particles as Gaussians, which a fit draws of others.
inline capture::Bitmap drawn(const mpm::Scene& scene, const mpm::FrameState& state,
                             const splat::Camera& camera) {
  std::vector<Vec3f> positions;
  std::vector<Mat3f> gradients;
  for (const mpm::BodyState& body : state.bodies) {
    positions.insert(positions.end(), body.positions.begin(), body.positions.end());
    gradients.insert(gradients.end(), body.deformation_gradients.begin(),
                     body.deformation_gradients.end());
  }
  const splat::Image image = splat::render(
      capture::particle_gaussians(positions, gradients, 0.4 * 0.5 * scene.dx), camera);
  capture::Bitmap bitmap(camera.width, camera.height);
  bitmap.has_alpha = true;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    bitmap.rgba[4 * i + 3] = static_cast<std::uint8_t>(std::lround(255.0 * image.mask[i]));
  }
  return bitmap;
}

/// What an image is made with.
using Filmed =
    std::function<capture::Bitmap(const mpm::Scene&, const mpm::FrameState&, const splat::Camera&)>;

/// Simulates `truth` and writes `folder`/clip: transforms.json and the images of each camera and
/// frame.
inline void film(
    const Json& truth, const fs::path& folder, const std::vector<splat::Camera>& cameras,
    const Filmed& filmed = [](const auto& scene, const auto& state, const auto& camera) {
      return paint(scene, state, camera);
    }) {
  const fs::path work = folder / "film";
  fs::create_directories(work);
  Json document = truth;
  document["task"] = "simulate";
  (void)run(document, work);
  const Job job = job_of(document, work);
  Arena arena(2);
  const Interrupter interrupter;
  const mpm::Scene scene = build_scene(job, arena, interrupter).scene;
  capture::CameraSet set;
  set.cameras = cameras;
  for (int frame = scene.first_frame; frame < scene.end_frame; ++frame) {
    const mpm::FrameState state = read_state(work / "out" / state_path(frame), scene);
    for (std::size_t k = 0; k < cameras.size(); ++k) {
      capture::Shot shot;
      shot.image = "c" + std::to_string(k) + "_" + std::to_string(frame) + ".png";
      shot.camera = k;
      capture::write_png(folder / "clip" / shot.image, filmed(scene, state, cameras[k]));
      set.shots.push_back(std::move(shot));
    }
  }
  write_file(folder / "clip/transforms.json", capture::format_cameras(set));
}

}  // namespace matterfit::job::fit_test
