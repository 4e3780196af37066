# SPDX-License-Identifier: GPL-3.0-or-later
"""MLS-MPM in Taichi, in the form of Taichi's own mpm3d example: a weakly compressible liquid without
F, array-of-fields particles, a dense grid, atomics. Run by bench_others.py.
"""

import json
import statistics
import sys
import time

import taichi as ti

THREADS = int(sys.argv[1])
ti.init(arch=ti.cpu, cpu_max_num_threads=THREADS, default_fp=ti.f32)

DENSITY = 1.0
STIFFNESS = 400.0
GRAVITY = 9.8


@ti.data_oriented
class Liquid:
    def __init__(self, grid):
        self.grid = grid
        self.dx = 1.0 / grid
        self.dt = 2e-4 * 32 / grid
        self.count = grid**3 // 4  # about four a cell where they are put
        self.volume = (0.5 * self.dx) ** 3
        self.mass = self.volume * DENSITY
        self.x = ti.Vector.field(3, float, self.count)
        self.v = ti.Vector.field(3, float, self.count)
        self.C = ti.Matrix.field(3, 3, float, self.count)
        self.J = ti.field(float, self.count)
        self.grid_v = ti.Vector.field(3, float, (grid,) * 3)
        self.grid_m = ti.field(float, (grid,) * 3)
        self.fill()

    @ti.kernel
    def fill(self):
        for p in self.x:
            self.x[p] = ti.Vector([ti.random() for _ in ti.static(range(3))]) * 0.4 + 0.15
            self.v[p] = ti.Vector([0.0, 0.0, 0.0])
            self.C[p] = ti.Matrix.zero(float, 3, 3)
            self.J[p] = 1.0

    @ti.kernel
    def step(self):
        for node in ti.grouped(self.grid_m):
            self.grid_v[node] = ti.zero(self.grid_v[node])
            self.grid_m[node] = 0.0
        ti.loop_config(block_dim=self.grid)
        for p in self.x:
            cell = self.x[p] / self.dx
            base = int(cell - 0.5)
            f = cell - base
            w = [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1) ** 2, 0.5 * (f - 0.5) ** 2]
            stress = -self.dt * 4 * STIFFNESS * self.volume * (self.J[p] - 1) / self.dx**2
            affine = ti.Matrix.identity(float, 3) * stress + self.mass * self.C[p]
            for offset in ti.static(ti.grouped(ti.ndrange(3, 3, 3))):
                d = (offset - f) * self.dx
                weight = w[offset[0]].x * w[offset[1]].y * w[offset[2]].z
                self.grid_v[base + offset] += weight * (self.mass * self.v[p] + affine @ d)
                self.grid_m[base + offset] += weight * self.mass
        for node in ti.grouped(self.grid_m):
            if self.grid_m[node] > 0:
                self.grid_v[node] /= self.grid_m[node]
            self.grid_v[node].y -= self.dt * GRAVITY
            for a in ti.static(range(3)):
                if (node[a] < 3 and self.grid_v[node][a] < 0) or (node[a] > self.grid - 3 and self.grid_v[node][a] > 0):
                    self.grid_v[node][a] = 0
        ti.loop_config(block_dim=self.grid)
        for p in self.x:
            cell = self.x[p] / self.dx
            base = int(cell - 0.5)
            f = cell - base
            w = [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1) ** 2, 0.5 * (f - 0.5) ** 2]
            v = ti.zero(self.v[p])
            C = ti.zero(self.C[p])
            for offset in ti.static(ti.grouped(ti.ndrange(3, 3, 3))):
                weight = w[offset[0]].x * w[offset[1]].y * w[offset[2]].z
                g = self.grid_v[base + offset]
                v += weight * g
                C += 4 * weight * g.outer_product((offset - f) * self.dx) / self.dx**2
            self.v[p] = v
            self.x[p] += self.dt * v
            self.J[p] *= 1 + self.dt * C.trace()
            self.C[p] = C


for grid in (32, 64, 128):
    liquid = Liquid(grid)
    liquid.step()
    ti.sync()
    rates = []
    for _ in range(5):
        steps, took, start = 0, 0.0, time.perf_counter()
        while took < 1.0:
            liquid.step()
            ti.sync()
            steps += 1
            took = time.perf_counter() - start
        rates.append(liquid.count * steps / took * 1e-6)
    line = {"name": "taichi mpm3d form", "formulation": "updated", "threads": THREADS}
    line |= {"particles": liquid.count, "mps": round(statistics.median(rates), 3)}
    print(json.dumps(line), flush=True)
