# SPDX-License-Identifier: GPL-3.0-or-later
"""Elastic bodies of tetrahedral finite elements, many runs of one mesh at a time.

Linear tetrahedra in the total Lagrangian form, lumped masses, symplectic Euler; the ground and what else
stands in the way are stiff penalties at the nodes with Coulomb friction. Nothing is shared with the
solver that is diagnosed: no grid, no particles, no transfer, no contact by volume.
Arrays lie as (3, runs, nodes), so that a step is some hundred operations of numpy whatever the mesh; single
precision, whose rounding is a thousandth of a recording's noise.
"""

import dataclasses
import itertools

import numpy as np

# Share of the longest stable step by the highest frequencies of elements and contacts.
COURANT = 0.8
# Stiffness of a contact, in that of an element's face.
CONTACT = 2.0
CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))
# Five tetrahedra of a cube: one inside, four at every second corner. The neighbours' are mirrored.
INSIDE = [[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]
FIVE = np.array([INSIDE, *([corner, *(c for c in INSIDE if np.abs(np.subtract(c, corner)).sum() == 1)]
                           for corner in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]))])
OUTWARD = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])  # faces of a tetrahedron


@dataclasses.dataclass
class Mesh:
    """Nodes (N, 3) [m], tetrahedra (T, 4) of positive volume, triangles (F, 3) of the skin, outward."""

    nodes: np.ndarray
    elements: np.ndarray
    skin: np.ndarray

    @property
    def surface(self):
        """Indices of the nodes of the skin, in order."""
        return np.unique(self.skin)

    def surface_faces(self):
        """The skin by places among `surface`."""
        return np.searchsorted(self.surface, self.skin)


def tetrahedra(cells, bend):
    """A mesh of the lattice cells (C, 3) of which `bend` maps corners (…, 3) to places."""
    odd = (cells.sum(axis=1) % 2).astype(bool)
    corners = np.repeat(FIVE[None], len(cells), axis=0)
    corners[odd, :, :, 0] = 1 - corners[odd, :, :, 0]
    lattice = (cells[:, None, None] + corners).reshape(-1, 3)
    unique, inverse = np.unique(lattice, axis=0, return_inverse=True)
    nodes, elements = bend(unique.astype(float)), inverse.reshape(-1, 4)
    edges = nodes[elements[:, 1:]] - nodes[elements[:, :1]]
    flipped = np.linalg.det(edges) < 0.0
    elements[flipped, 2:] = elements[flipped, :1:-1]
    faces = elements[:, OUTWARD].reshape(-1, 3)
    _, index, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return Mesh(nodes, elements, faces[index[count == 1]])


@dataclasses.dataclass
class Obstacle:
    """A `plane` (point, normal) or a `ball` (centre, radius) that is not passed."""

    kind: str
    place: np.ndarray
    normal: np.ndarray = None
    radius: float = 0.0
    friction: float = 0.3

    def distance(self, x):
        """Signed distance (runs, nodes) and outward normal (3, runs, nodes) of places (3, …)."""
        arm = x - np.asarray(self.place, np.float32)[:, None, None]
        if self.kind == "plane":
            normal = np.asarray(self.normal, np.float32)[:, None, None]
            return (arm * normal).sum(axis=0), np.broadcast_to(normal, x.shape)
        length = np.maximum(np.sqrt((arm * arm).sum(axis=0)), 1e-9)
        return length - self.radius, arm / length


@dataclasses.dataclass
class Run:
    """A throw, and everything that may act on it; neutral where it is not given."""

    young: float  # [Pa]
    poisson: float
    density: float  # [kg/m³]
    velocity: tuple  # of the centre of mass [m/s]
    spin: tuple  # [rad/s]
    gravity: tuple = (0.0, 0.0, -9.81)
    obstacles: list = dataclasses.field(default_factory=list)
    bounce_damping: float = 0.0  # of contacts, as a share of critical
    drag_rate: float = 0.0  # [1/s]
    drag_per_mass: float = 0.0  # ½ ρ c_d A over the body's mass [1/m]
    wind: tuple = (0.0, 0.0, 0.0)  # [m/s]
    viscosity: float = 0.0  # against shear [Pa s]
    stiffness: np.ndarray = None  # factors of the elements (T,)
    extra_mass: np.ndarray = None  # of the nodes (N,) [kg]
    kick: tuple = None  # begin, end [s], acceleration (3,) [m/s²], shares of the nodes (N,)
    tether: tuple = None  # anchor (3,), length [m], acceleration per metre beyond it [1/s²]
    field: tuple = None  # centre (3,), radius, begin, end [s], acceleration (3,) at the centre
    breath: tuple = None  # amplitude, frequency [Hz]: how the body would swell if it were free


def _cross(a, b):
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


class _Batch:
    """The runs' numbers as arrays (runs, 1) and the mesh at rest."""

    def __init__(self, mesh, runs):
        self.runs = runs
        self.count, self.nodes = len(runs), len(mesh.nodes)
        self.elements = np.ascontiguousarray(mesh.elements.T)
        edges = (mesh.nodes[mesh.elements[:, 1:]] - mesh.nodes[mesh.elements[:, :1]]).transpose(0, 2, 1)
        self.volumes = np.linalg.det(edges) / 6.0
        if not (self.volumes > 0.0).all():
            raise ValueError("an element of the mesh is turned inside out")
        inverse = np.linalg.inv(edges)
        self.inverse = np.ascontiguousarray(inverse.transpose(1, 2, 0), np.float32)  # [k][j]: (T,)
        gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        self.steepness = np.sqrt((gradients**2).sum(axis=(1, 2)).max())  # √ Σ |∇N|² of the flattest [1/m]
        share = np.bincount(mesh.elements.ravel(), np.repeat(self.volumes / 4.0, 4))

        def column(values):
            return np.array(values, np.float32)[:, None]

        young, nu = column([r.young for r in runs]), column([r.poisson for r in runs])
        factors = np.stack([np.ones(len(self.volumes)) if r.stiffness is None else r.stiffness
                            for r in runs]).astype(np.float32)
        self.mu = factors * young / (2.0 * (1.0 + nu))
        self.lam = factors * young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        self.mass = column([r.density for r in runs]) * share.astype(np.float32)
        # Waves are those of the material, without what is hung on it.
        self.speed = np.sqrt(((self.lam + 2.0 * self.mu).max(axis=1) / [r.density for r in runs]).max())
        for b, run in enumerate(runs):
            if run.extra_mass is not None:
                self.mass[b] += run.extra_mass
        self.gravity = np.array([r.gravity for r in runs], np.float32).T[:, :, None]
        self.rate = column([r.drag_rate for r in runs])
        self.drag = column([r.drag_per_mass for r in runs])
        self.wind = np.array([r.wind for r in runs], np.float32).T[:, :, None]
        self.viscous = np.flatnonzero([r.viscosity > 0.0 for r in runs])
        self.viscosity = column([r.viscosity for r in runs])
        triangles = mesh.nodes[mesh.skin]
        areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
        area = np.bincount(mesh.skin.ravel(), np.repeat(areas / 6.0, 3), minlength=self.nodes)
        edge = np.cbrt(self.volumes.mean() * 6.0)
        self.push = (CONTACT * young / edge * area).astype(np.float32)  # [N/m] (runs, nodes)
        self.weights = self.volumes.astype(np.float32)
        self.of_nodes = (self.elements[None] + self.nodes * np.arange(self.count)[:, None, None]).ravel()

    def step(self):
        """The one that is taken [s]."""
        # An element's highest frequency with a quarter of its mass at each node bounds that of the mesh.
        dt = COURANT * 2.0 / np.hypot(2.0 * self.speed * self.steepness, np.sqrt((self.push / self.mass).max()))
        for run in self.runs:
            if run.viscosity > 0.0:
                dt = min(dt, 0.15 * run.density / (run.viscosity * self.steepness**2))
        return dt

    def _gradient(self, x, inverse):
        """Columns of the deformation gradient [j] (3, runs, T)."""
        first = x[:, :, self.elements[0]]
        d = [x[:, :, self.elements[k]] - first for k in (1, 2, 3)]
        return [d[0] * inverse[0][j] + d[1] * inverse[1][j] + d[2] * inverse[2][j] for j in range(3)]

    def _swelling(self, time):
        return np.array([1.0 + r.breath[0] * np.sin(2.0 * np.pi * r.breath[1] * time) if r.breath else 1.0
                         for r in self.runs], np.float32)[:, None]

    def internal(self, x, v, time):
        """Forces (3, runs, nodes) of the neo-Hookean law with λ/2 ln² J, and of viscosity [N]."""
        inverse = self.inverse
        if any(r.breath for r in self.runs):
            inverse = inverse[:, :, None, :] / self._swelling(time)
        f = self._gradient(x, inverse)
        cofactor = [_cross(f[1], f[2]), _cross(f[2], f[0]), _cross(f[0], f[1])]
        j = (f[0] * cofactor[0]).sum(axis=0)
        if not (j > 0.0).all():
            raise FloatingPointError("an element turned inside out")
        share = (self.lam * np.log(j) - self.mu) / j
        stress = [self.mu * f[k] + share * cofactor[k] for k in range(3)]
        if len(self.viscous):
            self._add_viscous(stress, v, cofactor, j)
        pull = [-self.weights * (stress[0] * inverse[k][0] + stress[1] * inverse[k][1] + stress[2] * inverse[k][2])
                for k in range(3)]
        on = np.stack([-(pull[0] + pull[1] + pull[2]), *pull], axis=2)  # (3, runs, 4, T)
        total = self.count * self.nodes
        sums = [np.bincount(self.of_nodes, on[c].ravel(), minlength=total) for c in range(3)]
        return np.stack(sums).reshape(3, self.count, self.nodes).astype(np.float32)

    def _add_viscous(self, stress, v, cofactor, j):
        """Cauchy stress η (L + Lᵀ − ⅔ tr L), as first Piola–Kirchhoff."""
        some = self.viscous
        rate = self._gradient(v[:, some], self.inverse)
        c = [part[:, some] for part in cofactor]
        # L = Ḟ F⁻¹ and F⁻¹ = cofactorᵀ / J.
        slope = [[sum(rate[k][a] * c[k][b] for k in range(3)) / j[some] for b in range(3)] for a in range(3)]
        third = 2.0 / 3.0 * (slope[0][0] + slope[1][1] + slope[2][2])
        eta = self.viscosity[some]
        cauchy = [[eta * (slope[a][b] + slope[b][a] - (third if a == b else 0.0)) for b in range(3)] for a in range(3)]
        for k in range(3):
            stress[k][:, some] += np.stack([sum(cauchy[a][b] * c[k][b] for b in range(3)) for a in range(3)])

    def external(self, x, v, time):
        """Accelerations of what acts from outside, (3, runs, nodes) [m/s²]."""
        relative = v - self.wind
        speed = np.sqrt((relative * relative).sum(axis=0))
        a = self.gravity - self.rate * v - self.drag * speed * relative
        for b, run in enumerate(self.runs):
            if run.kick and run.kick[0] <= time < run.kick[1]:
                a[:, b] += np.asarray(run.kick[2])[:, None] * run.kick[3]
            if run.field and run.field[2] <= time < run.field[3]:
                arm = x[:, b] - np.asarray(run.field[0])[:, None]
                near = np.maximum(1.0 - (arm * arm).sum(axis=0) / run.field[1] ** 2, 0.0)
                a[:, b] += np.asarray(run.field[4])[:, None] * near**3
            if run.tether:
                arm = x[:, b] - np.asarray(run.tether[0])[:, None]
                length = np.maximum(np.sqrt((arm * arm).sum(axis=0)), 1e-9)
                a[:, b] -= run.tether[2] * np.maximum(length - run.tether[1], 0.0) * arm / length
        return a

    def touch(self, x, v, dt):
        """Changes velocities of nodes inside obstacles."""
        for b, run in enumerate(self.runs):
            for obstacle in run.obstacles:
                if obstacle.kind == "plane" and obstacle.normal[2] == 1.0:
                    near = np.flatnonzero(x[2, b] < obstacle.place[2])
                    if len(near) == 0:
                        continue
                else:
                    near = np.arange(self.nodes)
                distance, normal = obstacle.distance(x[:, b : b + 1, near])
                inside = distance[0] < 0.0
                if not inside.any():
                    continue
                which, n, deep = near[inside], normal[:, 0, inside], -distance[0, inside]
                w, stiff, mass = v[:, b, which], self.push[b, which], self.mass[b, which]
                out = (w * n).sum(axis=0)
                force = stiff * deep - 2.0 * run.bounce_damping * np.sqrt(stiff * mass) * np.minimum(out, 0.0)
                jump = dt * force / mass
                along = w - out * n
                sliding = np.maximum(np.sqrt((along * along).sum(axis=0)), 1e-12)
                along *= np.maximum(0.0, 1.0 - obstacle.friction * jump / sliding)
                v[:, b, which] = along + (out + jump) * n


def simulate(mesh, runs, fps, frames):
    """Positions (runs, frames, nodes, 3) [m] at multiples of 1/fps."""
    batch = _Batch(mesh, runs)
    x = np.repeat(mesh.nodes.T[:, None], len(runs), axis=1).astype(np.float32)
    v = np.empty_like(x)
    for b, run in enumerate(runs):
        mass = batch.mass[b]
        arm = mesh.nodes - (mass[:, None] * mesh.nodes).sum(axis=0) / mass.sum()
        v[:, b] = (np.asarray(run.velocity) + np.cross(run.spin, arm)).T
    substeps = int(np.ceil(1.0 / (fps * batch.step())))
    dt = 1.0 / (fps * substeps)
    seen = [x.copy()]
    for step in range((frames - 1) * substeps):
        time = step * dt
        v += dt * (batch.internal(x, v, time) / batch.mass + batch.external(x, v, time))
        batch.touch(x, v, dt)
        x += dt * v
        if (step + 1) % substeps == 0:
            seen.append(x.copy())
    return np.array(seen).transpose(2, 0, 3, 1)
