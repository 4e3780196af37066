# SPDX-License-Identifier: GPL-3.0-or-later
"""Genesis' MPM on the CPU: an elastic cube falling on its floor. Run by bench_others.py."""

import json
import statistics
import sys
import time

import genesis as gs

THREADS = int(sys.argv[1])
SUBSTEPS = 10

gs.init(backend=gs.cpu, precision="32", logging_level="error")
for edge in (0.4, 0.8):
    separation = 0.02
    scene = gs.Scene(
        show_viewer=False,
        sim_options=gs.options.SimOptions(dt=2e-3, substeps=SUBSTEPS),
        mpm_options=gs.options.MPMOptions(
            lower_bound=(-1.0, -1.0, -0.2),
            upper_bound=(1.0, 1.0, 1.8),
            grid_density=1.0 / (2.0 * separation),
            particle_size=separation,
        ),
    )
    scene.add_entity(
        gs.morphs.Box(pos=(0, 0, 0.5 * edge + 0.1), size=(edge, edge, edge)),
        material=gs.materials.MPM.Elastic(E=1e5, nu=0.3, rho=1000.0, sampler="regular"),
    )
    scene.build()
    count = scene.mpm_solver.n_particles
    scene.step()
    rates = []
    for _ in range(5):
        steps, took, start = 0, 0.0, time.perf_counter()
        while took < 1.0:
            scene.step()
            steps += SUBSTEPS
            took = time.perf_counter() - start
        rates.append(count * steps / took * 1e-6)
    line = {"name": "genesis mpm", "formulation": "updated", "threads": THREADS}
    line |= {"particles": count, "mps": round(statistics.median(rates), 3)}
    print(json.dumps(line), flush=True)
