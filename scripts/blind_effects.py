# SPDX-License-Identifier: GPL-3.0-or-later
"""What the blind benchmark hides: each effect as finite elements, as our own solver, and as a camera has it.

`Hidden.name` is that of the catalogue (docs/formats.md, the report of a diagnosis). Its size is one number
`a`, which blind_hide.py scales to the strength that it wants; directions and places are drawn before.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from blind_elements import Obstacle

AIR = 1.204  # [kg/m³]
FPS = 60
LIGHT = ("drag_linear", "drag_quadratic", "wind")  # told of light bodies only


@dataclasses.dataclass
class Scene:
    """What the hiding program knows of a case before anything is hidden."""

    mesh: object
    density: float
    young: float
    friction: float  # that is claimed
    floor: bool
    velocity: np.ndarray
    spin: np.ndarray
    half: float  # [m]
    seconds: float

    @property
    def volume(self):
        e = self.mesh.nodes[self.mesh.elements]
        return float(np.linalg.det(e[:, 1:] - e[:, :1]).sum() / 6.0)

    @property
    def mass(self):
        return self.density * self.volume

    @property
    def centre(self):
        return self.mesh.nodes.mean(axis=0)


@dataclasses.dataclass
class Hidden:
    """`start`: the first size that is tried; `most`: the largest. `draw(scene, random)` gives directions and
    places. `act(run, a, where, scene)` changes a blind_elements.Run, `own(document, a, where, scene)` a job
    document of ours, `see(positions, times, a, where)` gives what is recorded of both."""

    name: str
    start: float
    most: float
    unit: str = ""
    scene: str = "any"  # `floor`, `air`, `any`
    signs: bool = True  # may be negative
    also: tuple = ()  # names that are true as well
    draw: Callable = None
    act: Callable = None
    own: Callable = None
    see: Callable = None
    number: str = ""  # the report's name of its size; empty: not compared
    observable: bool = True  # at all, in a recording of a body that is free from its first frame
    factor: Callable = None  # of `a` to what the report says, from the scene; none: 1


def _horizontal(_, random):
    angle = random.uniform(0.0, 2.0 * np.pi)
    return {"direction": [float(np.cos(angle)), float(np.sin(angle)), 0.0]}


def _drag_per_mass(coefficient, scene):
    area = np.pi * (3.0 * scene.volume / (4.0 * np.pi)) ** (2.0 / 3.0)
    return 0.5 * AIR * coefficient * area / scene.mass


def _set(attribute, value):
    """An `act` that sets one attribute of the run to `value(a, where, scene)`."""

    def act(run, a, where, scene):
        setattr(run, attribute, value(a, where, scene))

    return act


def _effect(entry):
    """An `own` that adds to the document's effects."""

    def own(document, a, where, scene):
        document["scene"].setdefault("effects", []).append(entry(a, where, scene))

    return own


def _wind(run, a, where, scene):
    run.drag_per_mass = _drag_per_mass(1.0, scene)
    run.wind = tuple(a * np.asarray(where["direction"]))


def _own_wind(document, a, where, _):
    document["scene"].setdefault("effects", []).extend([
        {"effect": "drag_quadratic", "drag_coefficient": 1.0},
        {"effect": "wind", "drag_coefficient": 1.0, "velocity": list(a * np.asarray(where["direction"]))}])


def _gravity(a, where, _):
    return tuple(np.array([0.0, 0.0, -9.81]) + a * np.asarray(where.get("direction", [0.0, 0.0, -1.0])))


def _own_gravity(document, a, where, scene):
    document["scene"]["gravity"] = list(_gravity(a, where, scene))


def _friction(run, a, _, scene):
    for obstacle in run.obstacles:
        obstacle.friction = max(0.0, scene.friction + a)


def _own_friction(document, a, _, scene):
    document["scene"]["colliders"][0]["contact"]["mu"] = max(0.0, scene.friction + a)


def _damping(a, _, scene):
    return a * scene.young


def _own_damping(document, a, where, scene):
    document["scene"]["bodies"][0]["material"]["damping_shear"] = _damping(a, where, scene)


def _own_bounce(document, a, *_):
    document["scene"]["colliders"][0]["contact"]["damping"] = a


def _tilt_normal(a, where):
    normal = np.array([0.0, 0.0, 1.0]) - a * np.asarray(where["direction"])
    return normal / np.linalg.norm(normal)


def _tilt(run, a, where, scene):
    foot = scene.centre * [1, 1, 0]
    for obstacle in run.obstacles:
        obstacle.place, obstacle.normal = foot, _tilt_normal(a, where)


def _own_tilt(document, a, where, scene):
    ground = document["scene"]["colliders"][0]
    ground.pop("height")
    ground.update(shape="plane", point=list(scene.centre * [1, 1, 0]), normal=list(_tilt_normal(a, where)))


def _draw_inclusion(scene, random):
    way = random.normal(size=3)
    return {"centre": (scene.centre + 0.35 * scene.half * way / np.linalg.norm(way)).tolist(),
            "radius": 0.55 * scene.half}


def _inclusion(a, where, scene):
    centres = scene.mesh.nodes[scene.mesh.elements].mean(axis=1)
    inside = np.linalg.norm(centres - where["centre"], axis=1) < where["radius"]
    return np.where(inside, max(0.1, 1.0 + a), 1.0)


def _draw_wall(scene, random):
    """A wall across the way, met between a third and half of the recording."""
    way = scene.velocity * [1, 1, 0]
    speed = np.linalg.norm(way)
    way = way / max(speed, 1e-9)
    front = (scene.mesh.nodes @ way).max() + speed * scene.seconds * random.uniform(0.25, 0.4)
    return {"point": (front * way).tolist(), "normal": (-way).tolist()}


def _wall(run, a, where, _):
    point = np.asarray(where["point"]) + (a - 1.0) * 0.03 * np.asarray(where["normal"])
    run.obstacles = [*run.obstacles, Obstacle("plane", point, np.asarray(where["normal"]), friction=0.3)]


def _own_wall(document, a, where, _):
    point = np.asarray(where["point"]) + (a - 1.0) * 0.03 * np.asarray(where["normal"])
    document["scene"].setdefault("colliders", []).append({
        "name": "wall", "shape": "plane", "point": point.tolist(), "normal": where["normal"],
        "contact": {"kind": "friction", "mu": 0.3}})


def _draw_mass(scene, random):
    node = int(random.choice(scene.mesh.surface))
    return {"node": node, "position": scene.mesh.nodes[node].tolist()}


def _extra_mass(a, where, scene):
    """Over the nodes near the place, as something glued on."""
    near = np.linalg.norm(scene.mesh.nodes - where["position"], axis=1) < 0.35 * scene.half
    return a * scene.mass * near / near.sum()


def _own_mass(document, a, where, scene):
    document["scene"]["bodies"][0]["masses"] = [{"position": where["position"], "mass": a * scene.mass}]


def _lens(about):
    def see(positions, times, a, where):
        return about(positions, times, a, where), times

    return see


def _clock(positions, times, a, _):
    return positions, times / (1.0 + a)


def _late(positions, times, a, _):
    return positions, times + a / len(times) * times[-1]


def _rolled(positions, _, a, where):
    """By a about the horizontal direction, through the first frame's centre."""
    n = np.asarray(where["direction"])
    pivot = positions[0].mean(axis=0)
    arm = positions - pivot
    along = (arm @ n)[..., None] * n
    return pivot + along + np.cos(a) * (arm - along) + np.sin(a) * np.cross(n, arm)


def _draw_kick(scene, random):
    way = random.normal(size=3)
    way /= np.linalg.norm(way)
    begin = random.uniform(0.25, 0.45) * scene.seconds
    side = (scene.mesh.nodes - scene.centre) @ random.normal(size=3)
    return {"direction": way.tolist(), "begin": begin, "end": begin + 0.08 * scene.seconds,
            "share": (side > np.median(side)).astype(float).tolist()}


def _kick(a, where, _):
    return where["begin"], where["end"], tuple(a * np.asarray(where["direction"])), np.asarray(where["share"])


def _draw_tether(scene, random):
    way = random.normal(size=3)
    way[2] = abs(way[2])
    way /= np.linalg.norm(way)
    return {"anchor": (scene.centre + 3.0 * scene.half * way).tolist(), "length": 3.0 * scene.half}


def _tether(a, where, _):
    return where["anchor"], where["length"], a


def _draw_field(scene, random):
    """A region in the way of the throw that pushes aside, for a while."""
    time = random.uniform(0.3, 0.45) * scene.seconds
    centre = scene.centre + scene.velocity * time - [0, 0, 0.5 * 9.81 * time**2]
    return {"centre": centre.tolist(), "radius": 2.5 * scene.half, "begin": time, **_horizontal(scene, random)}


def _field(a, where, scene):
    end = where["begin"] + 4.0 / FPS
    return where["centre"], where["radius"], where["begin"], end, tuple(a * np.asarray(where["direction"]))


def _own_field(document, a, where, _):
    first = where["begin"] * FPS
    push = (a * np.asarray(where["direction"])).tolist()
    document["scene"].setdefault("effects", []).append({
        "effect": "force_field", "center": where["centre"], "radius": where["radius"],
        "acceleration": {"frames": [0, first, first + 4], "values": [[0, 0, 0], push, [0, 0, 0]],
                         "interpolation": "step"}})


EFFECTS = {h.name: h for h in [
    Hidden("drag_linear", 0.5, 4.0, "1/s", "air", False, (), None,
           _set("drag_rate", lambda a, *_: a), _effect(lambda a, *_: {"effect": "drag_linear", "rate": a}),
           number="rate"),
    Hidden("drag_quadratic", 1.0, 4.0, "", "air", False, (), None,
           _set("drag_per_mass", lambda a, _, scene: _drag_per_mass(a, scene)),
           _effect(lambda a, *_: {"effect": "drag_quadratic", "drag_coefficient": a}), number="drag_coefficient"),
    # Air that moves is air: what names its drag as well says nothing false.
    Hidden("wind", 4.0, 15.0, "m/s", "air", False, ("drag_quadratic",), _horizontal, _wind, _own_wind),
    Hidden("gravity_size", 0.5, 4.0, "m/s²", act=_set("gravity", _gravity), own=_own_gravity, number="added"),
    Hidden("gravity_direction", 0.4, 3.0, "m/s²", signs=False, draw=_horizontal, act=_set("gravity", _gravity),
           own=_own_gravity),
    Hidden("friction", 0.15, 0.5, "", "floor", act=_friction, own=_own_friction, number="added"),
    Hidden("restitution", 0.2, 0.9, "", "floor", False, act=_set("bounce_damping", lambda a, *_: a), own=_own_bounce,
           number="damping"),
    Hidden("ground_tilt", 0.06, 0.3, "", "floor", False, draw=_horizontal, act=_tilt, own=_own_tilt),
    Hidden("damping_shear", 5e-4, 4e-3, "s", "floor", False, (), None, _set("viscosity", _damping), _own_damping,
           number="added", factor=lambda scene: scene.young),
    Hidden("stiffness_inclusion", 2.0, 6.0, "", "floor", False, draw=_draw_inclusion,
           act=_set("stiffness", _inclusion)),
    Hidden("hidden_collider", 1.0, 1.0, "", "any", False, draw=_draw_wall, act=_wall, own=_own_wall),
    Hidden("attached_mass", 0.2, 0.8, "of the body's", "any", False, draw=_draw_mass,
           act=_set("extra_mass", _extra_mass), own=_own_mass, number="mass", factor=lambda scene: scene.mass),
    Hidden("frame_rate", 0.03, 0.3, "", see=_clock, number="factor"),
    Hidden("scale", 0.03, 0.3, "", see=_lens(lambda x, t, a, w: x * (1.0 + a)), number="factor"),
    Hidden("camera_drift", 0.05, 0.5, "m/s", "floor", False, draw=_horizontal,
           see=_lens(lambda x, t, a, w: x + a * t[:, None, None] * np.asarray(w["direction"]))),
    Hidden("camera_roll", 0.04, 0.3, "rad", "any", False, draw=_horizontal, see=_lens(_rolled)),
    # A late clock is another throw.
    Hidden("time_offset", 1.0, 1.0, "frames", see=_late, observable=False),
]}
# Outside the catalogue; the right answer is `unknown`, or a name of `also` where the catalogue has grown.
OUTSIDE = {h.name: h for h in [
    Hidden("kick", 20.0, 200.0, "m/s²", "any", False, draw=_draw_kick, act=_set("kick", _kick)),
    Hidden("tether", 20.0, 400.0, "1/s²", "air", False, draw=_draw_tether, act=_set("tether", _tether)),
    Hidden("breath", 0.04, 0.15, "", "floor", False, draw=lambda s, r: {"frequency": r.uniform(3.0, 8.0)},
           act=_set("breath", lambda a, where, _: (a, where["frequency"]))),
    Hidden("gust", 10.0, 80.0, "m/s²", "air", False, ("force_field",), _draw_field, _set("field", _field),
           _own_field),
]}
ALL = EFFECTS | OUTSIDE
