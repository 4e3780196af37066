# SPDX-License-Identifier: GPL-3.0-or-later
"""What each number of a material, a body, a contact or a motion is: its name and unit for people,
its limits and default, how a fit looks for it. The one table of these; properties, panels, presets
and fits read it.

A quantity is found by its key, the job document's words below its owner: `material.E`, `contact.mu`.
"""

import math
import re
from dataclasses import dataclass, replace

# In which scale steps are equal: x, ln x, ln(x / (½ - x)).
LINEAR, LOG, LOGIT = "linear", "log", "logit"

RANGE = 1e4  # a LOG quantity without bounds of its own is looked for this factor either side
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
    deviation that a prior begins with; where the scene has 0, `share` of the body's stiffness is a
    start, or .1 without one.
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
    share: float = 0.0
    short: str = ""

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


def _form(number):
    """A direction in the weights of the neural law."""
    return Quantity(f"material.form_{number}", f"Form {number}", "",
                    "How far the form of the stress is from that of the start weights, along one "
                    "direction of them; 1 changes it by its own size",
                    least=-5.0, most=5.0, soft=(-1.0, 1.0), precision=3, step=1, scale=LINEAR,
                    low=-2.0, high=2.0, sigma=0.3)


_MATERIAL = (
    Quantity("material.E", "Young's Modulus", "Pa",
             "Stiffness in tension, in pascals: jelly 1e4, rubber 1e6, wood 1e10",
             short="Young's", default=1e5, least=1e-3, most=9.9e12, soft=(1e2, 1e9), precision=0, step=10000,
             absent=None, positive=True, low=1e2, high=1e10),
    Quantity("material.nu", "Poisson's Ratio", "",
             "Sideways shrinking over stretching, without unit: .5 keeps its volume",
             short="Poisson's", default=0.3, least=-0.89, most=0.4999, soft=(0.0, 0.499), precision=4, step=1,
             absent=None, scale=LOGIT, low=0.01, high=0.495),
    Quantity("material.yield_stress", "Yield Stress", "Pa",
             "Uniaxial stress in pascals from which the material keeps its new shape",
             short="Yield", default=5e3, soft=(1.0, 1e6), precision=1, step=1000, absent=None, share=1e-2),
    Quantity("material.hardening", "Hardening", "Pa",
             "Growth of the yield stress in pascals per unit of plastic strain",
             soft=(0.0, 1e6), precision=1, step=1000, share=1e-2),
    Quantity("material.viscosity", "Viscosity", "Pa s",
             "Dynamic viscosity in pascal seconds: water .001, honey 10, toothpaste 100",
             default=1.0, most=9.9e8, soft=(1e-3, 1e4), precision=4, step=10, share=1e-4),
    Quantity("material.exponent", "Flow Exponent", "",
             "Herschel-Bulkley exponent, without unit: below 1 it thins as it flows",
             short="Exponent", default=1.0, least=0.1, most=4.0, soft=(0.3, 1.5), step=5, absent=1.0,
             low=0.1, high=4.0),
    Quantity("material.friction_angle", "Friction Angle", "°",
             "Angle of internal friction in degrees: dry sand 25 to 40",
             short="Friction", default=30.0, most=79.9, soft=(10.0, 50.0), precision=1, step=50, absent=None,
             scale=LINEAR, low=5.0, high=65.0, sigma=5.0),
    Quantity("material.cohesion", "Cohesion", "Pa",
             "Shear strength without pressure, in pascals: dry sand 0, wet sand 1e3",
             most=1e9, soft=(0.0, 1e5), precision=1, step=100, share=1e-3),
    Quantity("material.bulk_modulus", "Bulk Modulus", "Pa",
             "Resistance to compression in pascals; lower than real water (2.2e9) so that the time "
             "step stays practical",
             short="Bulk", default=1e5, least=1.0, soft=(1e3, 1e8), precision=0, step=10000, absent=None,
             positive=True),
    *(_form(number) for number in (1, 2, 3, 4)),
    Quantity("material.yield_strain", "Yield Strain", "",
             "Change of shape from which the material keeps its new shape, without unit; from 100 on "
             "never",
             default=1e3, most=1e6, soft=(0.0, 1.0), precision=4, step=1, absent=1e3, low=1e-5,
             high=1e3),
    Quantity("material.internal_friction", "Internal Friction", "",
             "Growth of the yield strain per loss of volume, as of grains under pressure",
             short="Int. Friction", most=100.0, soft=(0.0, 2.0), precision=3, step=1, low=1e-4,
             high=10.0),
    Quantity("material.strain_hardening", "Strain Hardening", "",
             "Growth of the yield strain per plastic strain, without unit",
             short="Hardening", most=1e3, soft=(0.0, 1.0), precision=3, step=1, low=1e-4, high=100.0),
    Quantity("material.tear_strain", "Tear Strain", "",
             "Growth of volume that it bears before it comes apart, without unit; from 100 on any",
             default=1e3, most=1e6, soft=(0.0, 1.0), precision=4, step=1, absent=1e3, low=1e-5,
             high=1e3),
    Quantity("material.flow_rate", "Flow Rate", "1/s",
             "How fast strain beyond the yield strain is lost; its inverse is the time of relaxation",
             default=1e9, least=1e-9, most=1e12, soft=(1e-2, 1e9), precision=1, step=1000,
             absent=1e9, positive=True, low=1e-3, high=1e11),
    Quantity("material.flow_thinning", "Flow Thinning", "1/s",
             "Growth of the flow rate per strain beyond the yield strain",
             short="Thinning", most=1e12, soft=(0.0, 1e9), precision=1, step=1000, low=1e-3, high=1e11),
    Quantity("material.latent", "Kind of Material", "",
             "Eight numbers that place it among all known materials, which lie within 4 of 0; a fit "
             "finds them",
             least=-6.0, most=6.0, soft=(-4.0, 4.0), precision=3, step=1, size=8, scale=LINEAR,
             low=-4.0, high=4.0, sigma=1.0),
    Quantity("material.weight_moves", "All Weights", "",
             "How far each weight of the neural law's energy is from the start's",
             least=-6.0, most=6.0, soft=(-1.0, 1.0), size=30, scale=LINEAR, low=-6.0, high=6.0,
             sigma=0.3),
    Quantity("material.correction", "Correction", "",
             "Shares by which stiffnesses grow beyond a strain, beside the law: the shear modulus from "
             "about 0.15, 0.4 and 1 of shear strain on, pull against pressure, and the bulk modulus; "
             "0 is the law itself",
             least=-50.0, most=50.0, soft=(-0.3, 2.0), precision=3, step=1, size=5, scale=LINEAR,
             low=-0.3, high=30.0, sigma=0.5),
    Quantity("material.damping_shear", "Shear Damping", "Pa s",
             "Kelvin-Voigt viscosity against change of shape, in pascal seconds",
             short="Shear", most=9.9e8, soft=(0.0, 1e4), precision=3, step=10, share=1e-4),
    Quantity("material.damping_bulk", "Bulk Damping", "Pa s",
             "Kelvin-Voigt viscosity against change of volume, in pascal seconds",
             short="Bulk", most=9.9e8, soft=(0.0, 1e4), precision=3, step=10, share=1e-4),
)
# Of one Maxwell branch; its key in a document has the branch's number.
_MAXWELL = (
    Quantity("material.maxwell.modulus", "Modulus", "Pa",
             "Shear modulus in pascals that the branch adds before it relaxes; the law's own "
             "stiffness is what stays",
             default=1e4, soft=(1.0, 1e9), precision=1, step=1000, absent=None),
    Quantity("material.maxwell.time", "Relaxation Time", "s",
             "Seconds in which a held stress of the branch falls to 37 %",
             short="Time", default=0.1, least=1e-6, most=1e5, soft=(1e-4, 100.0), precision=5, step=1,
             absent=None, positive=True),
)
DENSITY = Quantity("density", "Density", "kg/m³",
                   "Mass per volume at rest, in kilograms per cubic metre: water 1000",
                   default=1000.0, least=1e-3, most=1e6, soft=(10.0, 8000.0), precision=1,
                   step=1000, absent=None, positive=True)
FRICTION = Quantity("contact.mu", "Friction", "",
                    "Coulomb's coefficient, without unit: 0 ice, .4 wood, 1 rubber",
                    default=0.4, most=10.0, soft=(0.0, 1.0), precision=3, low=1e-3, high=3.0)
STIFFNESS = Quantity("contact.stiffness", "Stiffness", "Pa/m",
                     "Pressure per depth of penetration, in pascals per metre",
                     default=1e7, least=1.0, most=1e15, soft=(1e4, 1e10),
                     precision=0, step=100000)
DAMPING = Quantity("contact.damping", "Damping", "",
                   "Normal damping while touching, as a fraction of critical damping",
                   default=0.1, most=2.0, soft=(0.0, 1.0), precision=3)
VELOCITY = Quantity("velocity", "Velocity", "m/s",
                    "Initial velocity of the centre of mass, per second",
                    least=-1e5, most=1e5, soft=(-20.0, 20.0), size=3, scale=LINEAR, reach=50.0,
                    sigma=1.0)
SPIN = Quantity("spin", "Spin", "rad/s",
                "Initial angular velocity about world axes through the centre of mass, in radians "
                "per second",
                least=-1e5, most=1e5, soft=(-20.0, 20.0), size=3, scale=LINEAR, reach=200.0,
                sigma=5.0)
POSITION = Quantity("placement.position", "Position", "m",
                    "World position of the object's origin at the start",
                    least=-1e6, most=1e6, soft=(-100.0, 100.0), precision=4, size=3, scale=LINEAR,
                    reach=1.0, sigma=0.02)
ROTATION = Quantity("placement.rotation", "Rotation", "rad",
                    "World rotation of the object at the start",
                    least=-1e3, most=1e3, soft=(-6.283185, 6.283185), size=3, scale=LINEAR,
                    reach=math.pi, sigma=0.1)
GRAVITY = Quantity("gravity", "Gravity", "m/s²",
                   "Acceleration of gravity in metres per second squared, whatever the scene's "
                   "scale",
                   least=-1e5, most=1e5, soft=(-30.0, 30.0), precision=3, size=3, scale=LINEAR,
                   reach=100.0, sigma=0.1)
HEIGHT = Quantity("height", "Height", "m", "World height of the floor",
                  least=-1e6, most=1e6, soft=(-10.0, 10.0), precision=4, scale=LINEAR,
                  low=-1.0, high=1.0, around=True, sigma=0.01)
START_FRAME = Quantity("start_frame", "Start Frame", "", "Scene frame of the capture's first sample",
                       default=1.0, least=-1e6, most=1e6, soft=(0.0, 1e4), scale=LINEAR,
                       low=-2.0, high=2.0, around=True, sigma=0.5)
# The pose of one camera of a recording by images has a key in a document and a title with the
# camera's number.
_POSES = (
    Quantity("poses.shift", "Camera {n}, Shift", "m",
             "How far a camera stands from where its file says, along the world's axes",
             least=-0.5, most=0.5, soft=(-0.1, 0.1), precision=4, size=3, scale=LINEAR, reach=0.5, sigma=0.02),
    Quantity("poses.turn", "Camera {n}, Turn", "rad",
             "How far a camera is turned against what its file says, about its own axes",
             least=-0.3, most=0.3, soft=(-0.1, 0.1), precision=4, size=3, scale=LINEAR, reach=0.3, sigma=0.02),
    Quantity("poses.focal", "Camera {n}, Focal Length", "",
             "Share by which a camera's focal length is longer than its file says",
             least=-0.2, most=0.2, soft=(-0.1, 0.1), precision=4, scale=LINEAR, low=-0.2, high=0.2, sigma=0.02),
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
