// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_check.hpp"

#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "mpm/unstable_error.hpp"

namespace matterfit::mpm {
namespace {

constexpr const char* kNoNumber = "is not a number";

[[noreturn]] void fail(const Scene& scene, const std::string& body, double time,
                       std::uint32_t particle, const Vec3d& x, const std::string& what) {
  const int frame = scene.first_frame + static_cast<int>(std::floor(time * scene.fps + 1e-6));
  std::ostringstream text;
  text << "Body '" << body << "', frame " << frame << " (" << time << " s): particle " << particle;
  if (what != kNoNumber) text << " at (" << x[0] << ", " << x[1] << ", " << x[2] << ") m";
  text << " " << what
       << ". Use a smaller scene.solver.dt_safety or particle separation, or gentler motion.";
  throw UnstableError(text.str());
}

/// What is wrong with a particle, or nothing. `too_fast` [m/s].
std::string wrong(const Mat3d& f, const Vec3d& v, double too_fast) {
  const double j = f.determinant();
  if (!std::isfinite(j) || !v.allFinite()) return kNoNumber;
  if (!(j > 0.0)) return "is turned inside out";
  if (v.cwiseAbs().maxCoeff() >= too_fast) {
    return "moves more than a cell in one substep, at " + std::to_string(v.norm()) + " m/s";
  }
  return {};
}

}  // namespace

template <class S>
void fail_updated(const Scene& scene, const UpdatedGrid<S>& grid,
                  const std::vector<UpdatedMember<S>>& members, double time, double dt,
                  double fastest) {
  const double too_fast =
      fastest >= 1.0 ? 0.999 * fastest * grid.dx / dt : std::numeric_limits<double>::infinity();
  for (std::size_t b = 0; b < grid.blocks.size(); ++b) {
    const UpdatedBlock<S>& block = grid.blocks[b];
    for (std::size_t m = 0; m < members.size(); ++m) {
      const auto look = [&](std::uint32_t id, const Vec3d& x, const Mat3d& f, const Vec3d& v) {
        const std::string what = wrong(f, v, too_fast);
        if (!what.empty()) fail(scene, members[m].name, time, id, x, what);
      };
      block.bodies[m].for_each([&](std::size_t s, const UpdatedChunk<S>& chunk, std::size_t l) {
        look(chunk.id[l], grid.position(grid.place(b, s, chunk, l)), deformation_gradient(chunk, l),
             particle_velocity(chunk, l));
      });
      for (const Crosser<S>& p : block.leaving[m]) {
        Mat3d f = Mat3d::Identity();
        for (int i = 0; i < 9; ++i) f(i / 3, i % 3) += static_cast<double>(p.h[i]);
        const Vec3d v(static_cast<double>(p.velocity[0]), static_cast<double>(p.velocity[1]),
                      static_cast<double>(p.velocity[2]));
        look(p.id, grid.origin(b) + Vec3d::Constant(2.5 * grid.dx), f, v);
      }
    }
  }
  fail(scene, members[0].name, time, 0, Vec3d::Zero(),
       "or another one is turned inside out or not a number");
}

template void fail_updated<float>(const Scene&, const UpdatedGrid<float>&,
                                  const std::vector<UpdatedMember<float>>&, double, double, double);
template void fail_updated<double>(const Scene&, const UpdatedGrid<double>&,
                                   const std::vector<UpdatedMember<double>>&, double, double,
                                   double);

}  // namespace matterfit::mpm
