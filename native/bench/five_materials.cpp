// SPDX-License-Identifier: GPL-3.0-or-later
// Makes the clips of the five-material set (docs/validation.md), which scripts/five_materials.py
// fits, and the sequences of five objects, which scripts/neural_sequences.py does.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/random.hpp"
#include "bench/material_set.hpp"
#include "bench/reference_mpm.hpp"
#include "bench/reference_shape.hpp"
#include "capture/npz.hpp"

namespace matterfit::bench {
namespace {

namespace fs = std::filesystem;

constexpr double kGravity = -9.81;
constexpr double kDensity = 1000.0;
/// The wave's way in a substep, in cells; cubic B-splines bear up to about 1.
constexpr double kCourant = 0.4;
constexpr std::size_t kTracks = 2000;
/// Points a set of a Chamfer distance.
constexpr std::size_t kCloud = 8192;

int substeps_per_frame(const ReferenceMaterial& material, double dx) {
  const double frame = 1.0 / kSetFramesPerSecond;
  const double wave = kCourant * dx / material.wave_speed(kDensity);
  // Explicit diffusion of momentum: ν dt/dx² ≤ 1/6, with room.
  const double viscous = 0.1 * dx * dx * kDensity / std::max(material.viscosity, 1e-9);
  return static_cast<int>(std::ceil(frame / std::min(wave, viscous)));
}

nlohmann::json parameters(const ReferenceMaterial& m) {
  switch (m.law) {
    case ReferenceLaw::kNeoHookean:
      return {{"E", m.youngs_modulus}, {"nu", m.poisson_ratio}};
    case ReferenceLaw::kNewtonian:
      return {{"bulk_modulus", m.bulk_modulus}, {"viscosity", m.viscosity}};
    case ReferenceLaw::kHerschelBulkley:
      return {{"E", m.youngs_modulus},
              {"nu", m.poisson_ratio},
              {"yield_stress", m.yield_stress},
              {"viscosity", m.viscosity}};
    case ReferenceLaw::kVonMises:
      return {{"E", m.youngs_modulus}, {"nu", m.poisson_ratio}, {"yield_stress", m.yield_stress}};
    case ReferenceLaw::kMullins:
      return {{"E", m.youngs_modulus},
              {"nu", m.poisson_ratio},
              {"stiffening", m.stiffening},
              {"softening", m.softening}};
    case ReferenceLaw::kDruckerPrager:
      break;
  }
  return {{"E", m.youngs_modulus}, {"nu", m.poisson_ratio}, {"friction_angle", m.friction_angle}};
}

/// The names of laws in job documents; `mullins` is of none.
const char* law_name(ReferenceLaw law) {
  switch (law) {
    case ReferenceLaw::kNeoHookean:
      return "neo_hookean";
    case ReferenceLaw::kNewtonian:
      return "newtonian";
    case ReferenceLaw::kHerschelBulkley:
      return "herschel_bulkley";
    case ReferenceLaw::kVonMises:
      return "von_mises";
    case ReferenceLaw::kMullins:
      return "mullins";
    case ReferenceLaw::kDruckerPrager:
      break;
  }
  return "drucker_prager";
}

std::vector<double> triple(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

/// Positions of some particles, frame after frame.
class Recorder {
 public:
  explicit Recorder(std::vector<std::size_t> chosen) : chosen_(std::move(chosen)) {}

  void record(const ReferenceMpm& mpm) {
    for (const std::size_t p : chosen_) {
      const Vec3d& x = mpm.particles()[p].x;
      for (int axis = 0; axis < 3; ++axis) values_.push_back(static_cast<float>(x[axis]));
    }
    ++frames_;
  }
  [[nodiscard]] capture::Array array() const { return {{frames_, chosen_.size(), 3}, values_}; }

 private:
  std::vector<std::size_t> chosen_;
  std::vector<float> values_;
  std::size_t frames_ = 0;
};

std::vector<std::size_t> shuffled(std::size_t count, std::uint64_t seed) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  Random random(seed);
  for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[random.next() % i]);
  return order;
}

/// Runs a clip and writes NAME_truth.npz, NAME.npz and, last, NAME.json.
void make(const SetClip& clip, double dx, const fs::path& folder) {
  const auto& shapes = reference_shapes();
  const auto shape = std::find_if(shapes.begin(), shapes.end(),
                                  [&](const ReferenceShape& s) { return s.name == clip.shape; });
  const Points rest = sample(*shape, clip.volume, clip.turn, 0.5 * dx, clip.clearance, clip.seed);
  const int substeps = substeps_per_frame(clip.material, dx);
  ReferenceMpm::Options options;
  options.dx = dx;
  options.dt = 1.0 / kSetFramesPerSecond / substeps;
  options.gravity = kGravity;
  options.density = kDensity;
  ReferenceMpm mpm(rest, clip.velocity, clip.spin, clip.material, options);

  // Two samples of the body that share no particle: one is the truth that a fit is scored against,
  // the other says where its own points start, and how far the two samples are apart by themselves.
  const std::vector<std::size_t> order = shuffled(rest.size(), clip.seed + 1);
  const auto half = static_cast<std::ptrdiff_t>(std::min(kCloud, rest.size() / 2));
  const auto tracks = std::min(static_cast<std::ptrdiff_t>(kTracks), half);
  Recorder tracked({order.begin(), order.begin() + tracks});
  Recorder own({order.begin(), order.begin() + half});
  Recorder truth({order.end() - half, order.end()});
  std::vector<double> times;
  for (int frame = 0; frame < kSetFrames; ++frame) {
    for (int step = 0; frame > 0 && step < substeps; ++step) mpm.step();
    for (Recorder* recorder : {&tracked, &own, &truth}) recorder->record(mpm);
    times.push_back(static_cast<double>(frame) / kSetFramesPerSecond);
  }

  std::vector<float> all;
  for (const Vec3d& x : rest) {
    for (int axis = 0; axis < 3; ++axis) all.push_back(static_cast<float>(x[axis]));
  }
  const capture::Array time_array({times.size()}, times);
  capture::write_npz(folder / (clip.name + "_truth.npz"),
                     {{"truth", truth.array()}, {"own", own.array()}, {"times", time_array}});
  capture::write_npz(folder / (clip.name + ".npz"),
                     {{"rest", capture::Array({rest.size(), 3}, all)},
                      {"positions", tracked.array()},
                      {"times", time_array}});
  const nlohmann::json description = {
      {"name", clip.name},
      {"simulator", "five_materials (MLS-MPM, cubic B-splines)"},
      {"shape", clip.shape},
      {"law", law_name(clip.material.law)},
      {"parameters", parameters(clip.material)},
      {"density", kDensity},
      {"volume", static_cast<double>(rest.size()) * std::pow(0.5 * dx, 3)},
      {"velocity", triple(clip.velocity)},
      {"spin", triple(clip.spin)},
      {"ground", 0.0},
      {"contact", "sticky"},
      {"gravity", {0.0, 0.0, kGravity}},
      {"fps", kSetFramesPerSecond},
      {"frames", kSetFrames},
      {"fitted_frames", kSetFittedFrames},
      {"simulator_grid_spacing", dx},
      {"simulator_substeps_per_frame", substeps},
      {"particles", rest.size()}};
  write_file(folder / (clip.name + ".json"), description.dump(1) + "\n");
}

int run(int argc, char** argv) {
  CLI::App app("Makes the clips of the five-material set: NAME.npz, NAME_truth.npz, NAME.json.");
  std::string folder = ".";
  std::vector<std::string> only;
  double dx = 0.016;
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  bool list = false;
  std::string set = "materials";
  app.add_option("--set", set, "materials: 45 clips; objects: five, four sequences each")
      ->check(CLI::IsMember({"materials", "objects"}));
  app.add_option("--folder", folder, "where they go");
  app.add_option("--only", only, "names, or beginnings of names")->delimiter(',');
  app.add_option("--dx", dx, "grid spacing [m]")->check(CLI::PositiveNumber);
  app.add_option("--threads", threads, "clips at a time")->check(CLI::PositiveNumber);
  app.add_flag("--list", list, "print the names and make nothing");
  CLI11_PARSE(app, argc, argv);

  std::vector<SetClip> clips = set == "objects" ? object_set() : material_set();
  const auto is_left_out = [&](const SetClip& clip) {
    return !only.empty() && std::none_of(only.begin(), only.end(), [&](const std::string& name) {
      return clip.name.compare(0, name.size(), name) == 0;
    });
  };
  clips.erase(std::remove_if(clips.begin(), clips.end(), is_left_out), clips.end());
  if (list) {
    for (const SetClip& clip : clips) std::printf("%s\n", clip.name.c_str());
    return 0;
  }
  fs::create_directories(folder);
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  std::mutex printing;
  const auto work = [&] {
    for (std::size_t i = next++; i < clips.size(); i = next++) {
      const auto start = std::chrono::steady_clock::now();
      std::string error;
      try {
        make(clips[i], dx, folder);
      } catch (const std::exception& caught) {
        error = caught.what();
        failed = true;
      }
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
      const std::lock_guard<std::mutex> lock(printing);
      std::fprintf(stderr, "%s %s (%.0f s)\n", clips[i].name.c_str(),
                   error.empty() ? "made" : error.c_str(), seconds.count());
    }
  };
  std::vector<std::thread> others;
  for (unsigned t = 1; t < threads; ++t) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
  return failed ? exit_status(ErrorKind::kCompute) : 0;
}

}  // namespace
}  // namespace matterfit::bench

int main(int argc, char** argv) {
  try {
    return matterfit::bench::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return matterfit::exit_status(matterfit::ErrorKind::kCompute);
  }
}
