# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of a fit: what is looked for, between which bounds, and how. What a fit found lies in
its cache folder (io/fit_results.py)."""

import bpy
from bpy.props import (
    BoolProperty,
    BoolVectorProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .. import laws
from . import reactions
from .compare import redraw
from .take import MatterfitTake


def _start_switched(self, _context):
    if self.use_start:
        reactions.fit_row_switched(self, "start")


def _bounds_switched(self, _context):
    if self.use_bounds:
        reactions.fit_row_switched(self, "bounds")


def _prior_switched(self, _context):
    if self.use_prior:
        reactions.fit_row_switched(self, "prior")


class MatterfitFitParameter(bpy.types.PropertyGroup):
    """A quantity that a fit may move; its values are SI whatever the scene's scale is."""

    name: StringProperty(name="Name", description="Owner and quantity, for searching the list")
    owner: StringProperty(
        name="Owner", description="The body or collider that has it; empty: the scene")
    key: StringProperty(
        name="Quantity", description="What it is, in the job document's words: material.E")
    enabled: BoolProperty(name="Fit", default=False, description="The fit looks for this value")
    axes: BoolVectorProperty(
        name="Axes", size=3, default=(True, True, True),
        description="Which of X, Y, Z are looked for; the others stay as they are set")
    use_start: BoolProperty(
        name="Start", default=False, update=_start_switched,
        description="Start from the value below instead of the one that is set now")
    start: FloatProperty(
        name="Start", default=0.0, min=-1e9, soft_min=-1e6, max=1e13, soft_max=1e10, precision=4,
        description="Where the search begins, in the unit of the parameter")
    start_vector: FloatVectorProperty(
        name="Start", size=3, min=-1e6, soft_min=-100.0, max=1e6, soft_max=100.0, precision=4,
        description="Where the search begins, in the unit of the parameter")
    use_bounds: BoolProperty(
        name="Bounds", default=False, update=_bounds_switched,
        description="Look between the values below instead of the wide bounds that it has by "
                    "itself")
    low: FloatProperty(
        name="Lowest", default=0.0, min=-1e9, soft_min=-1e6, max=1e13, soft_max=1e10, precision=4,
        description="The search does not go below this, in the unit of the parameter")
    high: FloatProperty(
        name="Highest", default=1.0, min=-1e9, soft_min=-1e6, max=1e13, soft_max=1e10, precision=4,
        description="The search does not go above this, in the unit of the parameter")
    reach: FloatProperty(
        name="Within ±", default=1.0, min=1e-9, soft_min=1e-3, max=1e6, soft_max=50.0, precision=4,
        description="The search goes no further than this from the start, on each axis")
    use_prior: BoolProperty(
        name="Prior", default=False, update=_prior_switched,
        description="Something is known of it beforehand: the value and deviation below count as "
                    "one more measurement")
    mean: FloatProperty(
        name="Expected", default=0.0, min=-1e9, soft_min=-1e6, max=1e13, soft_max=1e10,
        precision=4, description="The value that is expected, in the unit of the parameter")
    mean_vector: FloatVectorProperty(
        name="Expected", size=3, min=-1e6, soft_min=-100.0, max=1e6, soft_max=100.0, precision=4,
        description="The value that is expected, in the unit of the parameter")
    sigma: FloatProperty(
        name="Deviation", default=0.2, min=1e-9, soft_min=1e-3, max=1e9, soft_max=100.0,
        precision=4,
        description="Standard deviation of what is expected: in the unit of the parameter for "
                    "velocities, angles, places, gravity and frames, else relative (0.2 is 20 %)")


class MatterfitFit(bpy.types.PropertyGroup):
    """Settings of the Fit panel."""

    law: EnumProperty(
        name="Law", default="BODY",
        items=(("BODY", "The Body's Law", "Fit the parameters of the law chosen in Bodies"),
               ("FIND", "Find the Law", "Fit several laws, and rank them by the error on what is "
                                        "held out"),
               ("UNKNOWN", "Unknown", "Give no class of material: eight numbers say where it lies "
                                      "among elastic solids, plastic ones, pastes, grains and "
                                      "liquids, and are looked for with its stiffness")),
        description="Whether the constitutive law itself is looked for")
    laws: EnumProperty(
        name="Candidates", items=laws.CANDIDATES, options={"ENUM_FLAG"},
        default={item[0] for item in laws.CANDIDATES},
        description="The laws that are fitted and ranked")
    parameters: CollectionProperty(type=MatterfitFitParameter)
    parameter_index: IntProperty(
        name="Active Parameter", default=0, min=0, max=100000, soft_max=100,
        description="The parameter shown below the list")
    loss: EnumProperty(
        name="Loss", default="TRACKS",
        items=(("TRACKS", "Tracks", "Distance of each recorded point to where the simulation has "
                                    "carried the same point"),
               ("CHAMFER", "Chamfer", "Nearest distances between clouds: for points that fill the "
                                      "body and are not the same ones from frame to frame"),
               ("SURFACE", "Surface", "Nearest distances to the body's surface: for points all "
                                      "around it that are not the same ones from frame to frame")),
        description="What is made small")
    use_huber: BoolProperty(
        name="Huber", default=False,
        description="Points that are far off count less: for recordings with outliers")
    huber: FloatProperty(
        name="Huber Threshold", default=3.0, min=0.1, soft_min=1.0, max=1e6, soft_max=10.0,
        precision=2, description="Errors beyond this many standard deviations count less")
    iterations: IntProperty(
        name="Iterations", default=30, min=1, soft_min=5, max=10000, soft_max=100,
        description="Most iterations in each stage")
    windows: BoolProperty(
        name="Growing Windows", default=True,
        description="Fit the first frames before the whole clip: safer from a poor start")
    levels: IntProperty(
        name="Resolutions", default=0, min=0, soft_min=0, max=4, soft_max=3,
        description="0: as many as pay; 1: the scene's own; 2: twice coarser first, then the "
                    "scene's; 3: four times, twice, then the scene's")

    weight_steps: IntProperty(
        name="All Weights", default=0, min=0, soft_max=30, max=1000,
        description="For the laws Neural (isotropic), whose energy has the weights, and Neural "
                    "(published): at most so many further steps at the end, with all weights. The "
                    "step that predicts best what is held out is taken, none where that is no "
                    "better than without")
    correction_steps: IntProperty(
        name="Correction", default=0, min=0, soft_max=30, max=1000,
        description="At most so many further steps at the end with a correction of five numbers "
                    "beside the law, whatever the law. The step that predicts best what is "
                    "held out is taken, none where that is no better than without")

    check: StringProperty(name="Check", description="What the last Check found, as JSON")
    run: PointerProperty(type=MatterfitTake)
    done: BoolProperty(name="Fitted", default=False, description="A fit has left a result")
    show_history: BoolProperty(
        name="Loss Curve", default=True, update=redraw,
        description="Draw the error of every iteration in the viewport; of a fit to images the misfit, as a share "
                    "of that after the first step of each search")
    show_error: BoolProperty(
        name="Fit's Error", default=True, update=redraw,
        description="Draw the fitted simulation's error of every frame in the viewport")
    show_curves: BoolProperty(
        name="Stress Curves", default=False, update=redraw,
        description="Draw the fitted material's stress against stretch in the viewport, with the nearest "
                    "known law beside it; shaded is what the recording showed")


CLASSES = (MatterfitFitParameter, MatterfitFit)
