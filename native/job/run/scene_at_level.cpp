// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/scene_at_level.hpp"

#include "capture/thin.hpp"
#include "job/run/build_scene.hpp"

namespace matterfit::job {

mpm::Scene scene_at_level(const Job& job, double level, Arena& arena,
                          const Interrupter& interrupter) {
  Job coarse = job;
  coarse.scene.particle_separation *= level;
  coarse.probes.clear();  // looked at in the job's own scene
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
