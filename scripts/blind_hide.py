# SPDX-License-Identifier: GPL-3.0-or-later
"""Hides effects in recordings: the first of the three programs of the blind benchmark.

    blind_hide.py SET [--seed N] [--cases N] [--only CASE …] [--tool FILE] [--places]

SET is `small` (a fixed two dozen) or `full` (--cases, 400). Writes below build/blind/SET
    cases/CASE/capture.npz, facts.json   what is recorded, and what the scene is said to be
    sealed/labels.json, CASE_again.npz   what was hidden, and another throw that nobody diagnoses
    seal.json                            SHA-256 of every sealed file, printed as well
    sealed/CASE_places.json, seal_places.json   where and when the recording is another for it, and their SHA-256
The same seed gives the same bytes. --places writes the last line's files alone, beside a set that was hidden
before there were any; all else of it stays as it is. Tiers (docs/validation.md): T0 our own solver with the
settings that `matterfit new-job` chooses, T1 at another resolution, grid offset and sampling, T2 finite
elements (blind_elements.py), T4 recordings of real bodies with the effect in them or added.
"""

import argparse
import copy
import hashlib
import itertools
import json
import pathlib
import resource
import signal
import subprocess
import sys
import zlib

import blind_elements
import blind_real
import blind_scoring
import numpy as np
from blind_effects import ALL, EFFECTS, FPS, LIGHT, OUTSIDE, Scene
from blind_elements import Obstacle, Run
from parts import BUILD, require_in_tree, say

FRAMES = 40
USED = 30  # of them; the rest is what `matterfit new-job` holds out
WAVES = 14.0  # speed of waves in the bodies [m/s]: impacts stay far below
SHAPES = {"block": (7, 5, 4), "pebble": (7, 6, 5), "bar": (10, 3, 3), "cube": (5, 5, 5), "plate": (8, 7, 3)}
# Nuisances that a fit takes along, and the step of their derivatives: velocity, spin, E, ν.
STEPS = {"velocity": 0.03, "spin": 0.1, "young": 0.05, "poisson": 0.02}
UNSEEN = 0.02  # of an effect's signature that the fit leaves: below it nothing can be named

LIMIT = 60  # of one simulation of our own [s of CPU]
TRIES = 4  # bodies that are drawn before a case is given up: a corner may be crushed flat

# tier, effects (none: nothing), scene where the effect leaves it open, noise, strength in standard deviations.
SMALL = [
    ("T0", [], "air", "white", 0), ("T0", [], "floor", "correlated", 0), ("T1", [], "air", "correlated", 0),
    ("T1", [], "floor", "white", 0), ("T2", [], "air", "white", 0), ("T2", [], "floor", "correlated", 0),
    ("T0", ["drag_quadratic"], "air", "white", 4), ("T2", ["drag_linear"], "air", "white", 6),
    ("T2", ["wind"], "air", "correlated", 6), ("T0", ["gravity_size"], "air", "white", 4),
    ("T2", ["gravity_direction"], "air", "white", 6), ("T1", ["friction"], "floor", "white", 8),
    ("T2", ["friction"], "floor", "white", 10), ("T1", ["damping_shear"], "floor", "white", 6),
    ("T2", ["damping_shear"], "floor", "white", 8), ("T2", ["stiffness_inclusion"], "floor", "white", 10),
    ("T2", ["hidden_collider"], "air", "white", 10), ("T2", ["time_offset"], "air", "white", 0),
    ("T2", ["frame_rate"], "air", "white", 6), ("T2", ["attached_mass"], "air", "white", 8),
    ("T0", ["drag_quadratic", "camera_roll"], "air", "white", 6), ("T2", ["wind", "frame_rate"], "air", "white", 6),
    ("T2", ["kick"], "air", "white", 10), ("T2", ["breath"], "floor", "white", 10),
    ("T4", ["golf_ball_1"], "", "", 0), ("T4", ["bowling_ball_1"], "", "", 0),
]
# How many in a hundred cases of `full` have nothing hidden, something outside the catalogue, two effects at
# once; the rest hide one.
SHARES = {"nothing": 27, "outside": 11, "pair": 11}


def plan(name, count, seed):
    """Rows as those of SMALL."""
    if name == "small":
        return SMALL
    random = np.random.default_rng(seed)
    rows = [("T4", list(effects), "", "", 0) for effects in blind_real.CASES]
    singles = {tier: itertools.cycle(names) for tier, names in {
        "own": random.permutation([n for n, h in EFFECTS.items() if h.own or h.see]),
        "T2": random.permutation(list(EFFECTS))}.items()}
    rest = count - len(rows)
    kinds = [kind for kind, share in SHARES.items() for _ in range(round(share * rest / 100))]
    kinds = random.permutation(kinds + ["single"] * (rest - len(kinds)))
    for number, kind in enumerate(kinds):
        tier = ("T0", "T1", "T2", "T2")[number % 4]
        strength = float(np.exp(random.uniform(np.log(0.7), np.log(20.0))))
        scene, noise = random.choice(["air", "floor"]), random.choice(["white", "correlated"])
        if kind == "nothing":
            effects, strength = [], 0.0
        elif kind == "outside":
            effects = [random.choice([n for n, h in OUTSIDE.items() if (h.act if tier == "T2" else h.own)])]
        elif kind == "pair":
            effects = _pair(random, tier, scene)
        else:
            effects = [next(singles["T2" if tier == "T2" else "own"])]
        rows.append((tier, [str(e) for e in effects], str(scene), str(noise), strength))
    return rows


def _pair(random, tier, scene):
    """Two that may be together: one that acts and one more, both seen."""
    names = [n for n, h in EFFECTS.items() if h.scene in ("any", scene) and n != "time_offset"
             and (tier == "T2" or h.own or h.see)]
    first = random.choice([n for n in names if not EFFECTS[n].see])
    return [first, random.choice([n for n in names if n != first and not _tied(n, first)])]


def _tied(a, b):
    groups = [{"drag_linear", "drag_quadratic", "wind"}, {"gravity_size", "frame_rate", "scale"},
              {"gravity_direction", "camera_roll", "ground_tilt"}]
    return any(a in group and b in group for group in groups)


def _turn(random):
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def draw_scene(random, floor, light):
    shape = SHAPES[random.choice(list(SHAPES))]
    half = random.uniform(0.08, 0.14)
    roundness = random.uniform(0.0, 0.5) if min(shape) > 3 else 0.0
    turn, size = _turn(random), np.array(shape)

    def bend(lattice):
        q = 2.0 * lattice / size - 1.0
        s = q * q
        ball = np.stack([q[:, a] * np.sqrt(1 - s[:, b] / 2 - s[:, c] / 2 + s[:, b] * s[:, c] / 3)
                         for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1))], axis=1)
        return ((1 - roundness) * q + roundness * ball) * size / size.max() * half @ turn.T

    mesh = blind_elements.tetrahedra(np.array(list(itertools.product(*map(range, shape)))), bend)
    density = random.uniform(20.0, 60.0) if light else random.uniform(200.0, 1200.0)
    way = random.uniform(0.0, 2.0 * np.pi)
    level = np.array([np.cos(way), np.sin(way), 0.0])
    if floor:
        mesh.nodes[:, 2] += random.uniform(0.03, 0.07) - mesh.nodes[:, 2].min()
        velocity = random.uniform(0.4, 1.5) * level - [0, 0, random.uniform(0.1, 0.6)]
        spin = random.normal(0.0, 1.5, 3)
    else:
        mesh.nodes[:, 2] += 1.5
        velocity = random.uniform(1.0, 3.0) * level + [0, 0, random.uniform(-1.0, 2.0)]
        spin = random.normal(0.0, 3.0, 3)
    return Scene(mesh, density, density * WAVES**2 * random.uniform(0.6, 1.5), random.uniform(0.25, 0.6), floor,
                 velocity, spin, half, (FRAMES - 1) / FPS)


def run_of(scene, poisson, effects=()):
    obstacles = [Obstacle("plane", np.zeros(3), np.array([0.0, 0.0, 1.0]), friction=scene.friction)]
    run = Run(scene.young, poisson, scene.density, tuple(scene.velocity), tuple(scene.spin),
              obstacles=obstacles if scene.floor else [])
    for hidden, a, where in effects:
        if hidden.act:
            hidden.act(run, a, where, scene)
    return run


def seen(positions, times, effects):
    for hidden, a, where in effects:
        if hidden.see:
            positions, times = hidden.see(positions, times, a, where)
    return positions, times


def nuisances(scene, poisson):
    """The runs whose differences from the first say what the fit may change."""
    runs = [run_of(scene, poisson)]
    for name, step in STEPS.items():
        for axis in range(3 if name in ("velocity", "spin") else 1):
            run = run_of(scene, poisson)
            value = getattr(run, name)
            if isinstance(value, tuple):
                setattr(run, name, tuple(v + step * (i == axis) for i, v in enumerate(value)))
            else:
                setattr(run, name, value * (1.0 + step) if name == "young" else value + step)
            runs.append(run)
    return runs


def differences(effects, base, changed, times, jacobian, used):
    """The difference d that effects make to what is recorded, and what the fit leaves of it, M d, both of the
    used samples; places and clocks of the first frame are the recording's own."""
    positions, stated = seen(changed, times, effects)
    at = np.array([[np.interp(times, stated, positions[:, i, c]) for c in range(3)]
                   for i in range(positions.shape[1])]).transpose(2, 0, 1)
    difference = (at - at[:1]) - (base - base[:1])
    d = difference[:USED][used]
    if not np.linalg.norm(d) > 0.0:
        return d, d
    return d, d - jacobian @ np.linalg.lstsq(jacobian, d, rcond=1e-9)[0]


def strength_of(effects, base, changed, times, jacobian, used, sigma):
    """‖M d‖/(σ√N) and the share ‖M d‖/‖d‖ that the fit leaves of the differences()."""
    d, left = differences(effects, base, changed, times, jacobian, used)
    whole = np.linalg.norm(d)
    if not whole > 0.0:
        return 0.0, 0.0
    return float(np.linalg.norm(left) / (sigma * np.sqrt(d.size))), float(np.linalg.norm(left) / whole)


def places_of(apart, sigma, first, visible):
    """{"raw": …, "left": …}: [[frame, region], …] where the mean of a region's points differs by more than
    3 σ/√n, n of them seen in that frame. `apart`: the same names, differences (USED, points, 3); `first`
    (points, 3) the recording's first frame, NaN where a point is not seen there."""
    region = blind_scoring.body_regions(first)
    found = {}
    for name, difference in apart.items():
        cells = []
        for frame in range(len(difference)):
            for number in range(region.max() + 1):
                inside = (region == number) & visible[frame]
                if inside.any():
                    mean = np.linalg.norm(difference[frame, inside].mean(axis=0))
                    if mean > 3.0 * sigma / np.sqrt(inside.sum()):
                        cells.append([frame, int(number)])
        found[name] = cells
    return found


def add_noise(random, positions, sigma, kind):
    """White, or from frame to frame .8 correlated with a third of its variance common to all points."""
    frames, points = positions.shape[:2]
    if kind == "white":
        return positions + random.normal(0.0, sigma, positions.shape)

    def wander(count):
        noise = random.normal(0.0, 1.0, (frames, count, 3))
        for f in range(1, frames):
            noise[f] = 0.8 * noise[f - 1] + 0.6 * noise[f]
        return noise

    return positions + sigma * (np.sqrt(2 / 3) * wander(points) + np.sqrt(1 / 3) * wander(1))


def gaps(random, frames, points):
    """Now and then a point is not seen for two to six frames; at the first all but a few are."""
    visible = np.ones((frames, points), bool)
    for _ in range(int(random.integers(0, points // 4))):
        point, begin = random.integers(0, points), random.integers(0, frames)
        visible[begin : begin + random.integers(2, 7), point] = False
    return visible


class Unsimulated(Exception):
    """A case that could not be made; it is left out, and said."""


class Hider:
    def __init__(self, options):
        self.options = options
        self.folder = BUILD / "blind" / options.set
        self.labels = {}

    def case(self, name, row):
        tier, names, *_ = row
        folder = self.folder / "cases" / name
        folder.mkdir(parents=True, exist_ok=True)
        if tier == "T4":
            if not self.options.places:
                self.labels[name] = blind_real.write(names, folder)
            return
        # Each case from its own seed, so that --only gives the same one.
        seed = zlib.crc32(f"{self.options.set} {self.options.seed} {name}".encode())
        for attempt in range(TRIES):
            try:
                self.labels[name] = self.make(name, row, np.random.default_rng([seed, attempt]), folder)
                return
            except FloatingPointError:
                pass
        raise Unsimulated("every body was crushed")

    def make(self, name, row, random, folder):
        """Writes the case; its label."""
        tier, names, place, noise_kind, strength = row
        hidden = [ALL[n] for n in names]
        floor = any(h.scene == "floor" for h in hidden) or (place == "floor" and all(h.scene != "air" for h in hidden))
        scene = draw_scene(random, floor, any(h.name in LIGHT for h in hidden))
        poisson, sigma = random.uniform(0.2, 0.33), float(np.exp(random.uniform(np.log(3e-4), np.log(1e-3))))
        law, particles = random.choice(["", "neo_hookean"]), int(self.options.particles)
        effects = [(h, h.start * (random.choice([-1.0, 1.0]) if h.signs else 1.0),
                    h.draw(scene, random) if h.draw else {}) for h in hidden]
        positions, s, keep, effects, apart = self.record(scene, poisson, effects, strength, sigma)
        if self.options.places:
            if not np.isclose(s, self.labels[name]["strength"], rtol=1e-6):
                raise FloatingPointError("another body was recorded")
            with np.load(folder / "capture.npz") as recorded:
                self.write_places(name, apart, sigma, recorded["positions"][0], recorded["visible"])
            return self.labels[name]
        again = self.again(random, scene, poisson, effects)
        if tier != "T2":
            settings = {"particles": particles, "law": "neo_hookean", "poisson": poisson}
            positions = self.own(name, tier, random, scene, effects, settings)
        times = np.arange(FRAMES) / FPS
        shown = scene.mesh.surface
        positions, stated = seen(positions[:, shown] if tier == "T2" else positions, times, effects)
        visible = gaps(random, FRAMES, len(shown))
        noisy = add_noise(random, positions, sigma, noise_kind)
        noisy[~visible] = np.nan
        self.write_places(name, apart, sigma, noisy[0], visible)
        np.savez(folder / "capture.npz", positions=noisy, times=stated, visible=visible,
                 faces=scene.mesh.surface_faces())
        facts = {"density": round(scene.density, 3), "noise": round(sigma, 6), "particles": particles}
        if floor:
            facts |= {"ground": 0.0, "friction": round(scene.friction, 4)}
        if law:
            facts["law"] = str(law)
        (folder / "facts.json").write_text(json.dumps(facts, indent=1), encoding="utf-8")
        np.savez(self.folder / "sealed" / f"{name}_again.npz", positions=again[0][:, shown], times=times)
        observable = keep >= UNSEEN or not hidden
        return {
            "tier": tier, "kind": self.kind(names, observable), "effects": names,
            "also": sorted({also for h in hidden for also in h.also}),
            "sizes": {h.name: {"value": a, "unit": h.unit, "number": h.number,
                               "expected": a * (h.factor(scene) if h.factor else 1.0),
                               **{k: v for k, v in where.items() if k != "share"}} for h, a, where in effects},
            "strength": s, "lambda": s * s * 3 * len(shown) * USED, "keep": keep, "noise": {"sigma": sigma,
                                                                                       "kind": noise_kind},
            "truth": {"E": scene.young, "nu": poisson, "velocity": scene.velocity.tolist(),
                      "spin": scene.spin.tolist(), "law": "neo_hookean", "floor": floor},
            "again": again[1],
        }

    def write_places(self, name, apart, sigma, first, visible):
        """What places_of() says, sealed apart from the labels."""
        places = places_of(apart, sigma, first, visible) | {"frames": USED}
        path = self.folder / "sealed" / f"{name}_places.json"
        path.write_text(json.dumps(places), encoding="utf-8")

    @staticmethod
    def kind(names, observable):
        if not names:
            return "nothing"
        if any(n in OUTSIDE for n in names):
            return "outside"
        if not observable:
            return "unobservable"
        return "pair" if len(names) > 1 else "single"

    @staticmethod
    def record(scene, poisson, effects, strength, sigma):
        """Node positions of finite elements with the effects, each at the strength that is wanted; the strength
        of all, the share of it that a fit leaves, the effects with their sizes, and what places_of() takes."""
        if not effects:
            still = blind_elements.simulate(scene.mesh, [run_of(scene, poisson)], FPS, FRAMES)[0]
            return still, 0.0, 0.0, effects, {}
        alone = [run_of(scene, poisson, [effect]) for effect in effects]
        nuisance = nuisances(scene, poisson)
        base, *rest = blind_elements.simulate(scene.mesh, nuisance + alone, FPS, FRAMES)
        shown, times = scene.mesh.surface, np.arange(FRAMES) / FPS
        used = np.ones((USED, len(shown), 3), bool)
        jacobian = np.stack([(x - base)[:USED, shown][used] for x in rest[: len(nuisance) - 1]], axis=1).astype(float)

        def measure(some, changed):
            return strength_of(some, base[:, shown], changed[:, shown], times, jacobian, used, sigma)

        sized = []
        for effect, changed in zip(effects, rest[len(nuisance) - 1 :], strict=True):
            hidden, a, where = effect
            s, _ = measure([effect], changed)
            # Once; of what is far from linear the strength is what it is.
            if s > 0.0 and strength > 0.0 and hidden.observable:
                a = float(np.sign(a) * min(hidden.most, abs(a) * strength / s))
            sized.append((hidden, a, where))
        changed = blind_elements.simulate(scene.mesh, [run_of(scene, poisson, sized)], FPS, FRAMES)[0]
        if not any(hidden.observable for hidden, *_ in sized):
            return changed, 0.0, 0.0, sized, {}
        d, left = differences(sized, base[:, shown], changed[:, shown], times, jacobian, used)
        apart = {"raw": d.reshape(USED, len(shown), 3), "left": left.reshape(USED, len(shown), 3)}
        return changed, *measure(sized, changed), sized, apart

    @staticmethod
    def again(random, scene, poisson, effects):
        """Another throw of the same body from the same place, without noise, and how it was thrown."""
        other = copy.copy(scene)
        other.velocity = scene.velocity * [-0.8, 1.1, 1.0] + random.normal(0.0, 0.2, 3) * [1, 1, 0.3]
        other.spin = random.normal(0.0, 2.0, 3)
        acting = [e for e in effects if e[0].act]
        positions = blind_elements.simulate(other.mesh, [run_of(other, poisson, acting)], FPS, FRAMES)[0]
        return positions, {"velocity": other.velocity.tolist(), "spin": other.spin.tolist(), "acts": bool(acting)}

    def own(self, name, tier, random, scene, effects, settings):
        """Tracks (frames, points, 3) of our own solver, of the skin's nodes."""
        work = self.folder / "sealed" / "work" / name
        work.mkdir(parents=True, exist_ok=True)
        shown = scene.mesh.surface
        still = np.repeat(scene.mesh.nodes[None, shown], FRAMES, axis=0)
        np.savez(work / "still.npz", positions=still, times=np.arange(FRAMES) / FPS,
                 faces=scene.mesh.surface_faces())
        particles = settings["particles"] * (1.0 if tier == "T0" else random.uniform(1.5, 4.0))
        facts = ["--density", scene.density, "--law", settings["law"], "--noise", 1e-4, "--particles", int(particles)]
        if scene.floor:
            facts += ["--ground", 0, "--friction", scene.friction]
        self.tool("new-job", work / "still.npz", "--output", work / "job.json", *facts)
        document = json.loads((work / "job.json").read_text(encoding="utf-8"))
        document.pop("fit")
        document["task"] = "simulate"
        document["captures"][0].pop("holdout", None)
        body = document["scene"]["bodies"][0]
        body["material"] = {"law": settings["law"], "E": scene.young, "nu": settings["poisson"]}
        body["velocity"], body["spin"] = scene.velocity.tolist(), scene.spin.tolist()
        if tier == "T1":
            document["scene"]["solver"] = {"grid_shift": random.uniform(0.0, 1.0, 3).round(3).tolist(),
                                           "dt_safety": float(random.uniform(0.3, 0.6))}
        for hidden, a, where in effects:
            if hidden.own:
                hidden.own(document, a, where, scene)
        (work / "truth.json").write_text(json.dumps(document, indent=1), encoding="utf-8")
        self.tool("simulate", work / "truth.json", "--quiet", "--threads", 1, "--restart")
        return np.load(work / "job_out" / "simulated.npz")["positions"]

    def tool(self, verb, *arguments):
        command = [str(a) for a in (self.options.tool, verb, *arguments)]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT + 5)))
        if done.returncode == -signal.SIGXCPU:
            raise Unsimulated(f"{verb} took more than {LIMIT} s of CPU")
        if done.returncode != 0:
            raise Unsimulated(f"{' '.join(command)}: {done.stdout.strip()[-600:]}")

    def run(self):
        (self.folder / "sealed").mkdir(parents=True, exist_ok=True)
        path = self.folder / "sealed" / "labels.json"
        if (self.options.only or self.options.places) and path.exists():
            self.labels = json.loads(path.read_text(encoding="utf-8"))
        for number, row in enumerate(plan(self.options.set, self.options.cases, self.options.seed)):
            name = f"{number:03d}"
            if self.options.places and self.labels.get(name, {}).get("kind") in (None, "not made"):
                continue
            if not self.options.only or name in self.options.only:
                try:
                    self.case(name, row)
                    say(f"{name} hidden")
                except (Unsimulated, blind_real.Missing) as error:
                    if self.options.places:
                        say(f"{name}: its places cannot be said: {error}")
                        continue
                    self.labels[name] = {"tier": row[0], "kind": "not made", "effects": row[1], "why": str(error)}
                    say(f"{name} could not be made: {error}")
                if not self.options.places:
                    # So that what is broken off can go on with --only; sealed is it at the end.
                    path.write_text(json.dumps(self.labels, indent=1, sort_keys=True), encoding="utf-8")
        self.seal("seal_places.json", sorted(path.parent.glob("*_places.json")))
        if self.options.places:
            return
        sealed = [path, *sorted(path.parent.glob("*_again.npz")), *sorted((self.folder / "cases").glob("*/*"))]
        seal = self.seal("seal.json", sealed)
        say(f"labels: SHA-256 {seal['sealed/labels.json']}")

    def seal(self, name, sealed):
        """Writes the hashes of files."""
        seal = {str(f.relative_to(self.folder)): hashlib.sha256(f.read_bytes()).hexdigest() for f in sealed}
        (self.folder / name).write_text(json.dumps(seal, indent=1), encoding="utf-8")
        return seal


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("set", choices=["small", "full"])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--particles", type=int, default=1500, help="of the claimed scene, about")
    parser.add_argument("--only", nargs="*", default=[], help="numbers of cases")
    parser.add_argument("--places", action="store_true", help="only where and when, beside what is hidden")
    parser.add_argument("--tool", type=pathlib.Path, default=BUILD / "bin" / "matterfit")
    Hider(parser.parse_args()).run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
