# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes clips of elastic bodies by finite elements, for other_simulators.py to fit.

    finite_elements.py [FOLDER] [--only NAME …]

Trilinear hexahedra, 2×2×2 points, lumped mass, symplectic Euler; the ground is a stiff penalty at the
nodes with Coulomb friction. Nothing is shared with the solver: no grid that the body moves through, no
transfer, no contact by particles. Writes FOLDER/NAME.npz and NAME.json (build/finite_elements), in the
form that other_simulators.py reads.
"""

import argparse
import json
import pathlib
import sys
import zlib

import numpy as np
from parts import BUILD, require_in_tree

FPS = 24
FRAMES = 20
TRACKS = 2000
GRAVITY = np.array([0.0, 0.0, -9.81])  # [m/s²]
# Share of the pressure waves' time along the shortest edge.
COURANT = 0.2
# Stiffness of the ground, in that of an element's face.
GROUND = 4.0
CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
SIGNS = 2 * CORNERS - 1  # their natural coordinates
GAUSS = SIGNS / np.sqrt(3.0)
FACES = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]])


def hexahedra(corners):
    """Nodes (N, 3) and elements (E, 8) of hexahedra by their corners (E, 8, 3)."""
    _, first, inverse = np.unique(np.round(corners.reshape(-1, 3), 9), axis=0, return_index=True, return_inverse=True)
    return corners.reshape(-1, 3)[first], inverse.reshape(-1, 8)


def lattice(shape):
    """Corners (E, 8, 3) of the unit cubes of a lattice."""
    cells = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), axis=-1).reshape(-1, 3)
    return (cells[:, None] + CORNERS).astype(float)


def block(width):
    """A mesh of cubes, n of them along its length: half sizes 1, `width`, `width`."""

    def mesh(n):
        shape = np.array([n, round(width * n), round(width * n)])
        return hexahedra((lattice(shape) - 0.5 * shape) * 2.0 / n)

    return mesh


def ball(n):
    """A cube of n³ elements with round sides in the middle, and six shells of n × n × n / 2 around it."""

    def bulged(p):
        """Half way between a cube and a ball."""
        size = np.abs(p).max(axis=-1, keepdims=True)
        length = np.linalg.norm(p, axis=-1, keepdims=True)
        return (0.25 + 0.3 * size / np.maximum(length, 1e-12)) * p

    corners = [bulged(lattice([n, n, n]) * 2.0 / n - 1.0)]
    layers = n // 2
    shell = lattice([n, n, layers])
    side = np.concatenate([shell[..., :2] * 2.0 / n - 1.0, np.ones_like(shell[..., :1])], axis=-1)
    share = shell[..., 2:] / layers
    # Equal angles on the sphere.
    outer = np.tan(side * np.pi / 4)
    shell = (1.0 - share) * bulged(side) + share * outer / np.linalg.norm(outer, axis=-1, keepdims=True)
    for axis in range(3):
        turned = np.roll(shell, axis + 1, axis=-1)
        corners += [turned, -turned[:, ::-1]]
    return hexahedra(np.concatenate(corners))


# Half size [m]; elements across; turn about y [rad]; centre, velocity and spin at frame 0.
CLIPS = {
    "ball": {"mesh": ball, "half": 0.1, "elements": 8, "E": 1.5e5, "nu": 0.35, "density": 1000.0,
             "turn": 0.0, "centre": [0, 0, 0.30], "velocity": [0.8, -0.2, -0.5], "spin": [2, 3, -1], "mu": 0.4},
    "bar": {"mesh": block(0.3), "half": 0.15, "elements": 20, "E": 3e5, "nu": 0.4,
            "density": 1100.0, "turn": 0.4, "centre": [0, 0, 0.30], "velocity": [-0.5, 0.3, -0.5],
            "spin": [0, -2, 1], "mu": 0.4},
    "cube": {"mesh": block(1.0), "half": 0.08, "elements": 12, "E": 2e5, "nu": 0.25,
             "density": 900.0, "turn": 0.3, "centre": [0, 0, 0.28], "velocity": [0.3, 0.4, -0.5],
             "spin": [1, -2, 3], "mu": 0.0},
}


def shape_functions(points):
    """(points, 8) at natural coordinates (points, 3)."""
    return np.prod(1.0 + SIGNS * points[:, None], axis=2) / 8.0


def shape_gradients(corners):
    """Gradients at rest (E, 8 points, 8 nodes, 3) [1/m] and volumes of the points (E, 8) [m³]."""
    rows = []
    for point in GAUSS:
        factors = 1.0 + SIGNS * point
        others = [factors[:, (a + 1) % 3] * factors[:, (a + 2) % 3] for a in range(3)]
        rows.append(SIGNS * np.stack(others, axis=1))
    natural = np.array(rows) / 8.0
    jacobian = np.einsum("qnj,eni->eqij", natural, corners)
    volumes = np.linalg.det(jacobian)
    if not (volumes > 0.0).all():
        raise ValueError("an element of the mesh is turned inside out")
    return np.matmul(natural, np.linalg.inv(jacobian)), volumes


def cofactors(f):
    """J F⁻ᵀ: its columns are crosses of F's."""
    a, b, c = f[..., 0], f[..., 1], f[..., 2]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)


def first_piola(lam, mu, f):
    """First Piola–Kirchhoff stress [Pa] of the neo-Hookean law with λ/2 ln² J."""
    cofactor = cofactors(f)
    j = (f[..., 0] * cofactor[..., 0]).sum(axis=-1)
    if not (j > 0.0).all():
        raise FloatingPointError("an element turned inside out")
    inverse = cofactor / j[..., None, None]
    return mu * (f - inverse) + (lam * np.log(j))[..., None, None] * inverse


class Body:
    """Elements, nodes and what a clip shows of them."""

    def __init__(self, clip, random):
        nodes, self.elements = clip["mesh"](clip["elements"])
        c, s = np.cos(clip["turn"]), np.sin(clip["turn"])
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        self.position = nodes * clip["half"] @ turn.T + clip["centre"]
        corners = self.position[self.elements]
        self.gradients, self.volumes = shape_gradients(corners)
        shares = clip["density"] * self.volumes @ shape_functions(GAUSS)
        self.mass = np.bincount(self.elements.ravel(), shares.ravel())
        edges = [corners[:, SIGNS[:, axis] > 0] - corners[:, SIGNS[:, axis] < 0] for axis in range(3)]
        self.edge = np.linalg.norm(edges, axis=-1).min()  # the shortest
        faces = self.elements[:, FACES].reshape(-1, 4)
        _, index, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        faces = faces[index[count == 1]]
        a, b, c, d = (self.position[faces[:, i]] for i in range(4))
        areas = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
        self.area = np.bincount(faces.ravel(), np.repeat(areas / 4.0, 4), minlength=len(self.position))
        centre = (self.mass[:, None] * self.position).sum(axis=0) / self.mass.sum()
        self.velocity = np.asarray(clip["velocity"]) + np.cross(clip["spin"], self.position - centre)
        self.shown = random.integers(0, len(self.elements), TRACKS)
        self.place = shape_functions(random.uniform(-1.0, 1.0, (TRACKS, 3)))

    def rest(self):
        """Eight points an element, inside it."""
        inside = shape_functions(SIGNS * 0.5)
        return np.einsum("qn,enc->eqc", inside, self.position[self.elements]).reshape(-1, 3)

    def tracks(self):
        return np.einsum("pn,pnc->pc", self.place, self.position[self.elements[self.shown]])

    def forces(self, lam, mu):
        f = np.matmul(self.position[self.elements].transpose(0, 2, 1)[:, None], self.gradients)
        pull = first_piola(lam, mu, f) * self.volumes[..., None, None]
        of_nodes = -np.matmul(self.gradients, pull.transpose(0, 1, 3, 2)).sum(axis=1)
        return np.stack([np.bincount(self.elements.ravel(), of_nodes[:, :, c].ravel()) for c in range(3)], axis=1)


def simulate(clip, random):
    """Rest points (M, 3) and tracks (FRAMES, TRACKS, 3) [m]."""
    young, nu = clip["E"], clip["nu"]
    mu, lam = young / (2 * (1 + nu)), young * nu / ((1 + nu) * (1 - 2 * nu))
    body = Body(clip, random)
    rest = body.rest()
    speed = np.sqrt((lam + 2 * mu) / clip["density"])
    substeps = int(np.ceil(speed / (FPS * COURANT * body.edge)))
    dt = 1.0 / (FPS * substeps)
    stiffness = GROUND * young / body.edge * body.area  # of the nodes on the ground [N/m]
    tracks = [body.tracks()]
    for step in range(1, (FRAMES - 1) * substeps + 1):
        acceleration = body.forces(lam, mu) / body.mass[:, None] + GRAVITY
        body.velocity += dt * acceleration
        below = np.flatnonzero(body.position[:, 2] < 0.0)
        push = -dt * stiffness[below] * body.position[below, 2] / body.mass[below]
        body.velocity[below, 2] += push
        sliding = np.linalg.norm(body.velocity[below, :2], axis=1)
        body.velocity[below, :2] *= np.maximum(0.0, 1.0 - clip["mu"] * push / np.maximum(sliding, 1e-12))[:, None]
        body.position += dt * body.velocity
        if step % substeps == 0:
            tracks.append(body.tracks())
    return rest, np.array(tracks)


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, nargs="?", default=BUILD / "finite_elements")
    parser.add_argument("--only", nargs="*", default=[], help="names of clips")
    options = parser.parse_args()
    unknown = set(options.only) - set(CLIPS)
    if unknown:
        parser.error(f"there is no clip {', '.join(sorted(unknown))}: {', '.join(CLIPS)}")
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in options.only or CLIPS:
        clip = CLIPS[name]
        print(f"Making {name}", file=sys.stderr, flush=True)
        rest, tracks = simulate(clip, np.random.default_rng(zlib.crc32(name.encode())))
        np.savez(options.folder / f"{name}.npz", rest=rest, positions=tracks, times=np.arange(FRAMES) / FPS)
        about = {
            "simulator": "finite elements (scripts/finite_elements.py)",
            "law": "neo_hookean",
            "density": clip["density"],
            "gravity": GRAVITY.tolist(),
            "ground": 0.0,
            "contact": f"friction {clip['mu']}" if clip["mu"] > 0.0 else "separating",
            "fps": FPS,
            "parameters": {"E": clip["E"], "nu": clip["nu"]},
            "velocity": clip["velocity"],
            "spin": clip["spin"],
        }
        (options.folder / f"{name}.json").write_text(json.dumps(about, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
