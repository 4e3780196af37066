// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "bake/picture.hpp"
#include "capture/carried_splats.hpp"
#include "capture/splats.hpp"
#include "job/clip_for_test.hpp"

/// A ball that is seen by splats of its own, and a clip of it.
namespace matterfit::job::fit_test {

inline const Vec3d kBallCentre(0.2, 0.1, 0.3);
inline constexpr double kBallRadius = 0.2;
inline constexpr double kBallSpin = 3.0;  // [rad/s] about the vertical, 93° over the clip

/// A ball of splats, of colours by their place that change a little with the direction they are
/// seen from.
inline capture::Splats coloured_ball() {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  capture::Splats splats;
  splats.sh_degree = 1;
  while (splats.size() < 900) {
    const Vec3f x(uniform(random), uniform(random), uniform(random));
    if (x.norm() > 1.0F) continue;
    splats.means.push_back(kBallCentre.cast<float>() + float(0.9 * kBallRadius) * x);
    splats.rotations.push_back(Eigen::Quaternionf(1.0F, x.x(), x.y(), x.z()).normalized());
    splats.scales.emplace_back(0.03F, 0.02F, 0.025F);
    splats.opacities.push_back(0.9F);
    const float wave = 0.8F * std::sin(std::atan2(x.y(), x.x()));
    const float above = x.z() > 0.0F ? 0.5F : -0.5F;
    splats.sh.insert(splats.sh.end(), {wave, above, -wave});
    for (int k = 0; k < 9; ++k) splats.sh.push_back(0.1F * uniform(random));
  }
  return splats;
}

inline Json ball_of_splats(double separation) {
  Json document = Json::parse(R"({ "schema": "matterfit.job/1", "task": "simulate",
    "scene": { "fps": 24, "frames": [0, 14], "gravity": [0, 0, 0],
      "bodies": [ { "name": "ball", "density": 1000, "velocity": [0.2, 0.1, 0],
        "placement": { "rotation": [0.9238795, 0, 0, 0.3826834] },
        "source": { "gaussians": "../ball.ply" },
        "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } } ] } })");
  document["scene"]["particle_separation"] = separation;
  return document;
}

inline Json fit_to_splats() {
  Json document = ball_of_splats(0.05);
  document["scene"]["bodies"][0]["source"]["gaussians"] = "ball.ply";
  document["task"] = "fit";
  document["captures"] = Json::array({{{"cameras", "clip/transforms.json"}}});
  document["captures"][0]["colours"] = {{"noise", 0.03}};
  document["captures"][0]["holdout"] = {{"frames", {12, 14}}};
  document["fit"] = {{"parameters", {"velocity", "spin[2]"}}};
  return document;
}

/// A clip of the ball that spins, drawn by the splats that particles of another separation carry,
/// in images so many times finer.
inline std::vector<splat::Camera> film_ball(const fs::path& folder, int finer = 1) {
  const capture::Splats splats = coloured_ball();
  capture::write_splats(folder / "ball.ply", splats);
  Json truth = ball_of_splats(0.04);
  truth["scene"]["bodies"][0]["spin"] = {0, 0, kBallSpin};
  const Quatd turn(0.9238795, 0, 0, 0.3826834);
  const Vec3d centre = turn * kBallCentre;
  std::vector<splat::Camera> cameras = {looking(centre + Vec3d(0.2, -1.5, 0.3), centre),
                                        looking(centre + Vec3d(1.6, 0.2, 0.2), centre)};
  for (splat::Camera& camera : cameras) {
    camera.width *= finer;
    camera.height *= finer;
    for (double* number : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *number *= finer;
  }
  film(truth, folder, cameras, [&](const auto& scene, const auto& state, const auto& camera) {
    Arena arena(2);
    const mpm::Body& body = scene.bodies.front();
    const capture::CarriedSplats carried(capture::placed(splats, Vec3d::Zero(), turn, 1.0), body,
                                         0.5 * scene.dx, arena);
    const capture::ParticleView view =
        capture::particle_view(body, state.bodies.front(), 0.5 * scene.dx);
    return bake::picture(splat::render(carried.at(view, arena), camera), std::nullopt);
  });
  return cameras;
}

}  // namespace matterfit::job::fit_test
