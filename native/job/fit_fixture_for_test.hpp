// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <filesystem>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "base/error.hpp"
#include "base/folder_for_test.hpp"
#include "base/interrupter.hpp"
#include "capture/npz.hpp"
#include "job/run_job.hpp"

/// A small body, captures that the simulator itself makes of it, and fits of them.
namespace matterfit::job::fit_test {

namespace fs = std::filesystem;

inline constexpr double kSize = 0.4;  // of the cube [m]

/// A cube of 512 particles thrown onto the ground; the truth of the captures.
inline Json thrown_cube() {
  return Json::parse(R"({ "schema": "matterfit.job/1", "task": "simulate",
    "scene": { "fps": 24, "frames": [0, 14], "particle_separation": 0.05,
      "bodies": [ { "name": "cube", "density": 1000, "velocity": [0.8, 0.3, -1.5],
        "source": { "box": { "low": [0, 0, 0.1], "high": [0.4, 0.4, 0.5] } },
        "material": { "law": "neo_hookean", "E": 3e4, "nu": 0.3 } } ],
      "colliders": [ { "name": "ground", "shape": "ground",
                       "contact": { "kind": "friction", "mu": 0.5, "stiffness": 6e5 } } ] } })");
}

inline Job job_of(const Json& document, const fs::path& folder) {
  ReadOptions options;
  options.base_folder = folder;
  return read_job(document.dump(), options);
}

inline Json run(const Json& document, const fs::path& folder, int threads = 2,
                Restart restart = Restart::kNever) {
  RunOptions options;
  options.threads = threads;
  options.restart = restart;
  Interrupter interrupter;
  return run_job(job_of(document, folder), options, interrupter);
}

/// Cancels when the progress has said each of `labels`, in this order.
inline Json cancelled_at(const Json& document, const fs::path& folder,
                         const std::vector<std::string>& labels) {
  Interrupter interrupter;
  const Job job = job_of(document, folder);
  std::thread watcher([&] {
    for (const std::string& label : labels) {
      while (interrupter.progress().label.find(label) == std::string::npos &&
             !interrupter.cancelled()) {
        std::this_thread::yield();
      }
    }
    interrupter.cancel();
  });
  RunOptions options;
  options.threads = 1;
  Json result;
  try {
    result = run_job(job, options, interrupter);
  } catch (const Error& error) {
    result = {{"status", error.what()}};
  }
  interrupter.cancel();
  watcher.join();
  return result;
}

/// 4 × 4 × 4 points inside the cube.
inline Points markers() {
  Points points;
  for (int k = 0; k < 4; ++k) {
    for (int j = 0; j < 4; ++j) {
      for (int i = 0; i < 4; ++i) {
        points.push_back(Vec3d(0.05, 0.05, 0.15) + 0.1 * Vec3d(i, j, k));
      }
    }
  }
  return points;
}

inline void write_tracks(const fs::path& path, const std::vector<double>& positions,
                         std::size_t frames, double fps) {
  std::vector<double> times;
  for (std::size_t t = 0; t < frames; ++t) times.push_back(double(t) / fps);
  capture::Arrays arrays;
  arrays["positions"] = capture::Array(
      {frames, positions.size() / 3 / std::max<std::size_t>(1, frames), 3}, positions);
  arrays["times"] = capture::Array({frames}, times);
  capture::write_npz(path, arrays);
}

/// As many random points inside the cube.
inline Points cloud(std::size_t count) {
  std::mt19937_64 generator(11);
  std::uniform_real_distribution<double> place(0.0, kSize);
  Points points;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = place(generator);
    const double y = place(generator);
    points.emplace_back(x, y, 0.1 + place(generator));
  }
  return points;
}

/// Those points, each moved onto the cube's nearest face.
inline Points shell(std::size_t count) {
  Points points = cloud(count);
  for (Vec3d& x : points) {
    const Vec3d from = x - Vec3d(0.2, 0.2, 0.3);
    int axis = 0;
    from.cwiseAbs().maxCoeff(&axis);
    x[axis] += (from[axis] > 0.0 ? 0.2 : -0.2) - from[axis];
  }
  return points;
}

/// What points on the truth's only body do, with Gaussian noise of `noise` times its size;
/// written to `folder`/`name`.npz.
inline void record(const Json& truth, const fs::path& folder, const std::string& name,
                   unsigned seed, double noise = 2e-3, const Points& points = markers()) {
  const auto range = truth["scene"]["frames"].get<std::vector<int>>();
  const auto frames = static_cast<std::size_t>(range[1] - range[0]);
  const double fps = truth["scene"]["fps"].get<double>();
  std::vector<double> still;
  for (std::size_t t = 0; t < frames; ++t) {
    for (const Vec3d& x : points) still.insert(still.end(), {x.x(), x.y(), x.z()});
  }
  const fs::path work = folder / ("truth_" + name);
  fs::create_directories(work);
  write_tracks(work / "still.npz", still, frames, fps);
  Json document = truth;
  document["captures"] = {{{"tracks", "still.npz"}}};
  (void)run(document, work);
  auto positions =
      capture::read_npz(work / "out/simulated.npz").at("positions").doubles("positions");
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, noise * kSize);
  for (double& x : positions) x += normal(generator);
  write_tracks(folder / (name + ".npz"), positions, frames, fps);
}

/// The fit of the truth's scene with a start that is off.
inline Json fit_of(const Json& truth, const std::vector<std::string>& parameters) {
  Json document = truth;
  document["task"] = "fit";
  document["captures"] = {{{"tracks", "a.npz"}, {"noise", 2e-3 * kSize}}};
  document["fit"] = {{"parameters", parameters}};
  return document;
}

inline double value_of(const Json& result, const std::string& path) {
  for (const Json& parameter : result.at("fit").at("parameters")) {
    if (parameter.at("path") == path) return parameter.at("value").get<double>();
  }
  throw_input("the result has no parameter " + path);
}

/// The values to the last bit.
inline std::string bits(const Json& result) {
  std::string text;
  for (const Json& parameter : result.at("fit").at("parameters")) {
    text += parameter.at("path").get<std::string>() + " " + parameter.at("value").dump() + " " +
            parameter.at("standard_error").dump() + "\n";
  }
  return text;
}

/// A start that is off by a factor five, at rest.
inline Json poor_start() {
  Json document = fit_of(thrown_cube(), {"material.E", "velocity"});
  document["scene"]["bodies"][0]["material"]["E"] = 1.5e5;
  document["scene"]["bodies"][0]["velocity"] = {0, 0, 0};
  return document;
}

/// A fit of a plastic body by an elastic law: however stiff, it stays far off.
inline Json of_the_wrong_law() {
  Json document = fit_of(thrown_cube(), {"material.E"});
  document["scene"]["bodies"][0]["material"] = {{"law", "neo_hookean"}, {"E", 1e5}, {"nu", 0.3}};
  document["scene"]["colliders"][0]["contact"].erase("stiffness");
  document["fit"]["parameters"] = {{{"path", "material.E"}, {"bounds", {1e4, 3e5}}}};
  document["fit"]["levels"] = {1};
  document["fit"]["windows"] = false;
  return document;
}

}  // namespace matterfit::job::fit_test
