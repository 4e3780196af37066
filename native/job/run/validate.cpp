// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/validate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <unordered_map>
#include <vector>

#include "base/error.hpp"
#include "base/parallel.hpp"
#include "job/documents/capture_scene.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/inputs.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/capture_input.hpp"
#include "job/run/image_sightings.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {
namespace {

// In separations; a point in a lattice has a particle within .87 and others on all sides of it, one
// beside a body the next ones on one side.
constexpr double kNear = 0.9;
constexpr double kAround = 1.6;
constexpr double kOneSided = 0.5;            // of the mean of those around, from the point
constexpr double kSmallestShare = 0.01;      // of the smaller body
constexpr std::size_t kFewestParticles = 4;  // particles

/// Particles of one body by cells of `size`, to be asked what lies near.
class Cells {
 public:
  Cells(const Points& points, double size) : points_(points), size_(size) {
    cells_.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) cells_[key(cell(points[i]))].push_back(i);
  }
  /// Whether `x` lies among the particles, `separation` apart; `size` is kAround separations.
  [[nodiscard]] bool hold(const Vec3d& x, double separation) const {
    const Eigen::Array3i centre = cell(x);
    double nearest = std::numeric_limits<double>::infinity();
    Vec3d sum = Vec3d::Zero();
    double count = 0;
    for (int n = 0; n < 27; ++n) {
      const Eigen::Array3i near = centre + Eigen::Array3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
      const auto found = cells_.find(key(near));
      if (found == cells_.end()) continue;
      for (const std::size_t i : found->second) {
        const Vec3d away = points_[i] - x;
        if (away.norm() > size_) continue;
        nearest = std::min(nearest, away.norm());
        sum += away;
        ++count;
      }
    }
    return nearest < kNear * separation && sum.norm() < kOneSided * separation * count;
  }

 private:
  [[nodiscard]] Eigen::Array3i cell(const Vec3d& x) const {
    return (x.array() / size_).floor().cast<int>();
  }
  [[nodiscard]] static std::uint64_t key(const Eigen::Array3i& cell) {
    constexpr std::uint64_t kMask = (std::uint64_t{1} << 21U) - 1;
    std::uint64_t found = 0;
    for (int a = 0; a < 3; ++a) {
      found = found << 21U | (static_cast<std::uint64_t>(cell[a]) & kMask);
    }
    return found;
  }

  const Points& points_;
  double size_;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> cells_;
};

bool compares(Task task) {
  return task == Task::kFit || task == Task::kDiagnose || task == Task::kCompare ||
         task == Task::kCheck;
}

void read_captures(const Job& job, const mpm::Scene& scene, std::vector<std::string>& statements,
                   const Interrupter& interrupter) {
  const bool clouds = job.fit && job.fit->loss != fit::Loss::kTracks;
  for (const SceneGroup& group : scene_groups(job)) {
    const Job one = group_job(job, group);
    for (std::size_t k = 0; k < one.captures.size(); ++k) {
      interrupter.check();
      (void)load_capture(one, k, clouds);
    }
  }
  // The other tasks look at tracks alone.
  if (job.task == Task::kCompare) {
    (void)load_films(job, scene, FilmUse::kCompared, statements, interrupter);
  } else if (job.task == Task::kFit) {
    const FilmUse use = job.captures.empty() ? FilmUse::kFitted : FilmUse::kBesideMore;
    (void)load_films(job, scene, use, statements, interrupter);
  }
}

}  // namespace

std::vector<Overlap> find_overlaps(const mpm::Scene& scene) {
  std::vector<Overlap> found;
  const double separation = 0.5 * scene.dx;
  for (std::size_t a = 0; a < scene.bodies.size(); ++a) {
    const Points& first = scene.bodies[a].rest;
    const Cells cells(first, kAround * separation);
    for (std::size_t b = a + 1; b < scene.bodies.size(); ++b) {
      const Points& second = scene.bodies[b].rest;
      Overlap overlap{a, b, 0, Vec3d::Zero()};
      for (const Vec3d& x : second) {
        if (!cells.hold(x, separation)) continue;
        ++overlap.particles;
        overlap.place += x;
      }
      const double few = std::max(double(kFewestParticles),
                                  kSmallestShare * double(std::min(first.size(), second.size())));
      if (double(overlap.particles) <= few) continue;
      overlap.place /= double(overlap.particles);
      // To a tenth of a separation: a middle that is 0 is not told as 4e-17.
      const double step = 0.1 * separation;
      overlap.place = (overlap.place.array() / step).round().matrix() * step;
      found.push_back(overlap);
    }
  }
  return found;
}

std::vector<std::string> validate_job(const Job& job, const RunOptions& options,
                                      const Interrupter& interrupter) {
  if (job.task == Task::kFit) (void)fit_of(job);
  check_captures(job);
  require_files(job);
  const auto arena = std::make_shared<Arena>(options.threads);
  BuiltScene built = build_scene(job, *arena, interrupter);
  for (const Overlap& overlap : find_overlaps(built.scene)) {
    throw_input(fmt::format(
        "Bodies '{}' and '{}' lie in each other, about ({:.3g}, {:.3g}, {:.3g}) m. Move one so "
        "that they touch at most.",
        built.scene.bodies[overlap.first].name, built.scene.bodies[overlap.second].name,
        overlap.place.x(), overlap.place.y(), overlap.place.z()));
  }
  std::vector<std::string> statements;
  if (compares(job.task)) read_captures(job, built.scene, statements, interrupter);
  // What lies in a collider, a pin that holds nothing, … is found where the solver takes it over.
  (void)mpm::Simulation(std::move(built.scene), arena, {options.target});
  return statements;
}

}  // namespace matterfit::job
