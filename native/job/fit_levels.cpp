// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_levels.hpp"

#include <algorithm>
#include <limits>

#include "capture/thin.hpp"
#include "job/run/build_scene.hpp"

namespace matterfit::job {
namespace {

/// Fewer particles than this are not worth a coarser level.
constexpr std::size_t kMany = 4000;
constexpr double kCellsAcross = 3.0;
constexpr int kCoarsest = 4;

/// Thinnest side of a body's box along its lattice, between the outermost particles [m].
double thinnest_side(const mpm::Body& body) {
  Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity());
  Vec3d high = -low;
  for (const Vec3d& x : body.rest) {
    const Vec3d at = body.lattice.axes.conjugate() * x;
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  return (high - low).minCoeff();
}

}  // namespace

std::vector<double> usual_levels(const std::vector<mpm::Scene>& scenes) {
  struct Size {
    double dx = 0.0;
    std::size_t particles = 0;
    double thinnest = std::numeric_limits<double>::infinity();  // [m]
  };
  std::vector<Size> sizes;
  for (const mpm::Scene& scene : scenes) {
    Size& size = sizes.emplace_back();
    size.dx = scene.dx;
    for (const mpm::Body& body : scene.bodies) {
      size.particles += body.rest.size();
      size.thinnest = std::min(size.thinnest, thinnest_side(body));
    }
  }
  std::vector<double> levels{1.0};
  for (int level = 2; level <= kCoarsest; level *= 2) {
    bool pays = true;
    const double half = level / 2.0;
    for (const Size& size : sizes) {
      pays = pays && size.thinnest / (level * size.dx) + 0.5 >= kCellsAcross &&
             double(size.particles) >= double(kMany) * half * half * half;
    }
    if (!pays) break;
    levels.insert(levels.begin(), level);
  }
  return levels;
}

mpm::Scene scene_at_level(const Job& job, double level, Arena& arena,
                          const Interrupter& interrupter) {
  Job coarse = job;
  coarse.scene.particle_separation *= level;
  mpm::Scene scene = build_scene(coarse, arena, interrupter).scene;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (job.scene.bodies[b].source.kind != Source::Kind::kPoints) continue;
    mpm::Body& body = scene.bodies[b];
    // A hull was filled anew.
    if (body.lattice.spacing == coarse.scene.particle_separation) continue;
    capture::thin(body.rest, body.volumes, level * body.lattice.spacing);
    body.lattice.spacing *= level;
    body.lattice.regular = false;
  }
  return scene;
}

}  // namespace matterfit::job
