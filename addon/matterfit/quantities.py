# SPDX-License-Identifier: GPL-3.0-or-later
"""What each number of a material, a body, a contact or a motion is: its name and unit for people,
its limits and default, how a fit looks for it. The one table of these; properties, panels, presets
and fits read it. What the library says of a number too (unit, scale, bounds, prior) comes from there
(library.py).

A quantity is found by its key, the job document's words below its owner: `material.E`, `contact.mu`.
"""

import re
from dataclasses import dataclass, replace

from . import library

# In which scale steps are equal: x, ln x, ln(x / (½ - x)).
LINEAR, LOG, LOGIT = "linear", "log", "logit"

RANGE = library.USUAL_FACTOR  # a quantity without bounds is looked for this factor either side
_UNITS = {"degrees": "°", "frames": ""}  # as the panel has them where the library has words
_BRANCH = re.compile(r"^material\.maxwell\[(\d+)\]\.(modulus|time)$")
_POSE = re.compile(r"^poses\[(\d+)\]\.(shift|turn|focal)$")


@dataclass(frozen=True)
class Quantity:
    """One row of the table; SI units.

    Shown: `title` and `about` in English, `unit` ("" without one), `short` a title for a narrow panel
    (the title itself where it is none), `least` and `most` that are allowed, `soft` limits of a
    slider, `precision` [digits] and `step` of the field; `size` 3 is a vector, a larger one a code,
    whose numbers are looked for together or not at all. Stored: `default` in a new scene, `absent`
    what a document means that leaves it out (None: it must not), `positive` where nothing can be
    simulated at 0.

    Fitted: `scale`; `low` and `high` are the bounds that it has by itself (0, 0: a factor RANGE
    either side of the start; `around`: about the start), `reach` that of vectors; `sigma` is the
    deviation that a prior begins with.
    """

    key: str
    title: str
    unit: str = ""
    about: str = ""
    default: float = 0.0
    least: float = 0.0
    most: float = 1e12
    soft: tuple = (0.0, 1e6)
    precision: int = 2
    step: int = 3  # hundredths, as Blender counts
    size: int = 1
    absent: float | None = 0.0
    positive: bool = False
    scale: str = LOG
    low: float = 0.0
    high: float = 0.0
    reach: float = 1.0
    around: bool = False
    sigma: float = 0.2
    short: str = ""

    def takes(self, value):
        """Whether its field holds the value, which it would clamp otherwise."""
        slack = 1e-6 * abs(value)  # fields have single precision
        return self.least - slack <= value <= self.most + slack and not (self.positive and value == 0.0)

    @property
    def caption(self):
        """What a panel has room for; the tooltip has unit and sentence."""
        return self.short or self.title

    @property
    def row(self):
        """The caption in a list, with the number of what it is of."""
        number, colon, _title = self.title.partition(": ")
        return f"{number}: {self.caption}" if colon and self.short else self.caption

    @property
    def label(self):
        """The title with the unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    @property
    def is_vector(self):
        return self.size == 3

    @property
    def is_code(self):
        return self.size > 3

    @property
    def name(self):
        """The last word of the key, by which a property group has it."""
        return self.key.rsplit(".", 1)[-1]


def _row(key, **panel):
    """The row of a key: what the library says of it (library.py), and in place of that and beside it
    what the panel says."""
    told = library.QUANTITIES[key]
    low, high = told["bounds"] or (0.0, 0.0)
    if told["size"] == 3:
        bounds = {"reach": high}
    else:
        bounds = {"low": low, "high": high, "around": told["around"]}
    return Quantity(key, **{"title": told["label"], "unit": _UNITS.get(told["unit"], told["unit"]),
                            "about": told["sentence"], "size": told["size"], "scale": told["coordinate"],
                            "sigma": told["prior_sigma"], **bounds, **panel})


def _form(number):
    """A direction in the weights of the neural law."""
    return _row(f"material.form_{number}", least=-5.0, most=5.0, soft=(-1.0, 1.0), precision=3, step=1)


_MATERIAL = (
    _row("material.E", short="Young's", default=1e5, least=1e-3, most=9.9e12, soft=(1e2, 1e9),
         precision=0, step=10000, absent=None, positive=True),
    _row("material.nu", short="Poisson's", default=0.3, least=-0.89, most=0.4999, soft=(0.0, 0.499),
         precision=4, step=1, absent=None),
    _row("material.yield_stress", short="Yield", default=5e3, soft=(1.0, 1e6), precision=1, step=1000,
         absent=None),
    _row("material.hardening", soft=(0.0, 1e6), precision=1, step=1000),
    _row("material.viscosity", default=1.0, most=9.9e8, soft=(1e-3, 1e4), precision=4, step=10),
    _row("material.exponent", short="Exponent", default=1.0, least=0.1, most=4.0, soft=(0.3, 1.5),
         step=5, absent=1.0),
    _row("material.friction_angle", short="Friction", default=30.0, most=79.9, soft=(10.0, 50.0),
         precision=1, step=50, absent=None),
    _row("material.cohesion", most=1e9, soft=(0.0, 1e5), precision=1, step=100),
    _row("material.bulk_modulus", short="Bulk",
         about="Resistance to compression; lower than real water (2.2e9 Pa) so that the time step stays "
               "practical",
         default=1e5, least=1.0, soft=(1e3, 1e8), precision=0,
         step=10000, absent=None, positive=True),
    *(_form(number) for number in (1, 2, 3, 4)),
    _row("material.yield_strain", default=1e3, most=1e6, soft=(0.0, 1.0), precision=4, step=1,
         absent=1e3),
    _row("material.internal_friction", short="Int. Friction", most=100.0, soft=(0.0, 2.0), precision=3,
         step=1),
    _row("material.strain_hardening", short="Hardening", most=1e3, soft=(0.0, 1.0), precision=3, step=1),
    _row("material.tear_strain", default=1e3, most=1e6, soft=(0.0, 1.0), precision=4, step=1,
         absent=1e3),
    _row("material.flow_rate", default=1e9, least=1e-9, most=1e12, soft=(1e-2, 1e9), precision=1,
         step=1000, absent=1e9, positive=True),
    _row("material.flow_thinning", short="Thinning", most=1e12, soft=(0.0, 1e9), precision=1, step=1000),
    # The library's rows of these are of one number of many.
    _row("material.latent", title="Kind of Material",
         about="Eight numbers that place it among all known materials, which lie within 4 of 0; a fit "
               "finds them",
         least=-6.0, most=6.0, soft=(-4.0, 4.0), precision=3, step=1, size=8),
    _row("material.weight_moves", title="All Weights",
         about="How far each weight of the neural law's energy is from the start's",
         least=-6.0, most=6.0, soft=(-1.0, 1.0), size=30),
    _row("material.correction",
         about="Shares by which stiffnesses grow beyond a strain, beside the law: the shear modulus from "
               "about 0.15, 0.4 and 1 of shear strain on, pull against pressure, and the bulk modulus; "
               "0 is the law itself",
         least=-50.0, most=50.0, soft=(-0.3, 2.0), precision=3, step=1, size=5),
    _row("material.damping_shear", short="Shear", most=9.9e8, soft=(0.0, 1e4), precision=3, step=10),
    _row("material.damping_bulk", short="Bulk", most=9.9e8, soft=(0.0, 1e4), precision=3, step=10),
)
# The rows of one Maxwell branch; its key in a document has the branch's number.
_MAXWELL = (
    _row("material.maxwell.modulus",
         about="Shear modulus that the branch adds before it relaxes; the law's own stiffness is what "
               "stays",
         default=1e4, soft=(1.0, 1e9), precision=1, step=1000, absent=None),
    _row("material.maxwell.time", short="Time", default=0.1, least=1e-6, most=1e5, soft=(1e-4, 100.0),
         precision=5, step=1, absent=None, positive=True),
)
DENSITY = _row("density", default=1000.0, least=1e-3, most=1e6, soft=(10.0, 8000.0), precision=1,
               step=1000, absent=None, positive=True)
FRICTION = _row("contact.mu", default=0.4, most=10.0, soft=(0.0, 1.0), precision=3)
STIFFNESS = _row("contact.stiffness", default=1e7, least=1.0, most=1e15, soft=(1e4, 1e10), precision=0,
                 step=100000)
# None that a fit moves: the library has no row of it.
DAMPING = Quantity("contact.damping", "Damping", "",
                   "Normal damping while touching, as a fraction of critical damping",
                   default=0.1, most=2.0, soft=(0.0, 1.0), precision=3)
VELOCITY = _row("velocity", least=-1e5, most=1e5, soft=(-20.0, 20.0))
SPIN = _row("spin", least=-1e5, most=1e5, soft=(-20.0, 20.0))
POSITION = _row("placement.position", about="World position of the object's origin at the start",
                least=-1e6, most=1e6, soft=(-100.0, 100.0), precision=4)
ROTATION = _row("placement.rotation", about="World rotation of the object at the start",
                least=-1e3, most=1e3, soft=(-6.283185, 6.283185))
GRAVITY = _row("gravity",
               about="Acceleration of gravity in metres per second squared, whatever the scene's scale",
               least=-1e5, most=1e5, soft=(-30.0, 30.0), precision=3)
HEIGHT = _row("height", about="World height of the floor", least=-1e6, most=1e6, soft=(-10.0, 10.0),
              precision=4)
START_FRAME = _row("start_frame", about="Scene frame of the capture's first sample", default=1.0,
                   least=-1e6, most=1e6, soft=(0.0, 1e4))
# The pose of one camera of a recording by images has a key in a document and a title with the
# camera's number.
_POSES = (
    _row("poses.shift", title="Camera {n}, Shift", least=-0.5, most=0.5, soft=(-0.1, 0.1), precision=4),
    _row("poses.turn", title="Camera {n}, Turn",
         about="How far a camera is turned against what its file says, about its own axes",
         least=-0.3, most=0.3, soft=(-0.1, 0.1), precision=4),
    _row("poses.focal", title="Camera {n}, Focal Length", least=-0.2, most=0.2, soft=(-0.1, 0.1),
         precision=4),
)
MOTION = (VELOCITY, SPIN, POSITION, ROTATION)

_TABLE = {row.key: row for row in (*_MATERIAL, *_MAXWELL, DENSITY, FRICTION, STIFFNESS, DAMPING,
                                   *MOTION, GRAVITY, HEIGHT, START_FRAME, *_POSES)}


def find(key):
    """The Quantity of a key, `material.maxwell[0].time` and `poses[0].shift` too; None where there is
    none."""
    camera = camera_of(key)
    if camera is not None:
        number, row = camera
        return replace(row, key=key, title=row.title.format(n=number))
    branch = branch_of(key)
    if branch is None:
        return _TABLE.get(key)
    number, name = branch
    row = _TABLE["material.maxwell." + name]
    return replace(row, key=key, title=f"{number + 1}: {row.title}")


def material(name):
    """The Quantity of a material's parameter: 'E', 'damping_shear', 'maxwell[0].time'."""
    return find("material." + name)


def branch_of(key):
    """(number from 0, 'modulus' or 'time') of a Maxwell branch's key; None for all others."""
    match = _BRANCH.match(key)
    return None if match is None else (int(match.group(1)), match.group(2))


def camera_of(key):
    """(number from 0, the row of all cameras) of a key of a camera's pose; None for all others."""
    match = _POSE.match(key)
    return None if match is None else (int(match.group(1)), _TABLE["poses." + match.group(2)])


def label_of(key):
    """The label of a key; the key itself where it is not known."""
    row = find(key)
    return key if row is None else row.label
