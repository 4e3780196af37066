// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_check.hpp"

#include <cmath>
#include <sstream>
#include <string>

#include "mpm/renewed_sample.hpp"
#include "mpm/total_stencil.hpp"
#include "mpm/unstable_error.hpp"

namespace matterfit::mpm {

template <class S>
void fail_renewed(const Scene& scene, const std::vector<RenewedBody<S>>& bodies,
                  const RenewedGrid& grid, const std::vector<double>& displacement, double time) {
  const int frame = scene.first_frame + static_cast<int>(std::floor(time * scene.fps + 1e-6));
  for (std::size_t m = 0; m < bodies.size(); ++m) {
    const RenewedBody<S>& body = bodies[m];
    for (std::size_t b = 0; b < body.blocks(); ++b) {
      if (body.extremes()[b].min_volume_ratio > S(0)) continue;
      BlockField field;
      field.gather(grid.nodes_of(m).data() + 8 * b, displacement.data());
      body.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
        const BlockField::Stencil s = block_stencil(place, scene.dx);
        const Vec3d x =
            place.position(block_origin(body.coordinates()[b], scene.dx), scene.dx) + field.at(s);
        const double j = (Mat3d::Identity() + field.gradient(s)).determinant() *
                         body.elastic(slot).determinant();
        if (j > 0.0 && std::isfinite(j)) return;
        std::ostringstream text;
        text << "Body '" << body.name() << "', frame " << frame << " (" << time << " s): particle "
             << body.store().id[slot];
        if (std::isfinite(j)) {
          text << " at (" << x[0] << ", " << x[1] << ", " << x[2]
               << ") m is turned inside out (volume ratio " << j << ").";
        } else {
          text << " is not a number.";
        }
        text << " Use a smaller scene.solver.dt_safety or particle separation, or gentler motion.";
        throw UnstableError(text.str());
      });
    }
  }
  throw UnstableError("Frame " + std::to_string(frame) +
                      ": a particle was turned inside out. Use a smaller scene.solver.dt_safety or "
                      "particle separation, or gentler motion.");
}

template void fail_renewed<float>(const Scene&, const std::vector<RenewedBody<float>>&,
                                  const RenewedGrid&, const std::vector<double>&, double);
template void fail_renewed<double>(const Scene&, const std::vector<RenewedBody<double>>&,
                                   const RenewedGrid&, const std::vector<double>&, double);

}  // namespace matterfit::mpm
