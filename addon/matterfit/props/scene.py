# SPDX-License-Identifier: GPL-3.0-or-later
"""The root of our settings: scene.matterfit; and window_manager.matterfit, which is not saved."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import compare, reactions
from .batch import MatterfitBatch
from .body import MatterfitBody, MatterfitPair
from .capture import MatterfitCapture
from .compare import MatterfitCompare
from .diagnosis import MatterfitDiagnosis
from .effects import MatterfitEffect
from .fit import MatterfitFit
from .solver import MatterfitOutput, MatterfitSolver
from .take import MatterfitTake

# Raised with every change of the properties that an older file needs help with (migration.py).
SCHEMA_VERSION = 4


def _take_switched(self, context):
    reactions.take_switched(self)
    reactions.pictures_switched(self)
    reactions.comparison_switched(self)
    compare.redraw(self, context)


def _capture_switched(self, _context):
    reactions.comparison_switched(self)


class MatterfitScene(bpy.types.PropertyGroup):
    """Everything of ours that a .blend file stores."""

    schema_version: IntProperty(
        name="Schema Version", default=0, min=0, max=1000000, soft_max=100, options={"HIDDEN"},
        description="Version of these settings; 0 in a scene that was never used")
    saved_in: StringProperty(name="Folder", options={"HIDDEN"},
                             description="The folder that paths of ours which begin with // are relative to")
    captures: CollectionProperty(type=MatterfitCapture)
    capture_index: IntProperty(name="Active Capture", default=0, min=0, max=100000, soft_max=100,
                               update=_capture_switched,
                               description="The capture shown below the list")
    bodies: CollectionProperty(type=MatterfitBody)
    body_index: IntProperty(name="Active Body", default=0, min=0, max=100000, soft_max=100,
                            description="The body shown below the list")
    effects: CollectionProperty(type=MatterfitEffect)
    effect_index: IntProperty(name="Active Effect", default=0, min=0, max=100000, soft_max=100,
                              description="The effect shown below the list")
    pairs: CollectionProperty(type=MatterfitPair)
    pair_index: IntProperty(name="Active Pair", default=0, min=0, max=100000, soft_max=100,
                            description="The pair of bodies shown below the list")
    solver: PointerProperty(type=MatterfitSolver)
    output: PointerProperty(type=MatterfitOutput)
    compare: PointerProperty(type=MatterfitCompare)
    diagnosis: PointerProperty(type=MatterfitDiagnosis)
    fit: PointerProperty(type=MatterfitFit)
    batch: PointerProperty(type=MatterfitBatch)
    preview: PointerProperty(type=MatterfitTake)
    takes: CollectionProperty(type=MatterfitTake)
    show_throws: BoolProperty(
        name="Show Throws", default=True, update=compare.redraw,
        description="Draw the velocity of each body, and how it would fly, in the viewport")
    show_curves: BoolProperty(
        name="Stress Curves", default=False, update=compare.redraw,
        description="Draw the active body's stress against stretch in the viewport; shaded is what its "
                    "material was seen at when it was fitted")
    take_index: IntProperty(name="Active Take", default=0, min=0, max=100000, soft_max=100,
                            update=_take_switched,
                            description="The take that is shown, baked and compared")


class MatterfitSession(bpy.types.PropertyGroup):
    """What this window manager knows and no file stores."""

    last_error: StringProperty(name="Last Error", description="The full text of the last error")
    last_report: StringProperty(name="Last Report", description="What the last job said")
    verify: StringProperty(name="Verification", description="What Verify found, a line a file")
    estimate: StringProperty(name="Estimate", description="What the next bake will need")
    estimate_fits: BoolProperty(name="Fits", default=True,
                                description="The next bake fits into memory")
    throw_index: IntProperty(name="Active Throw", default=0, min=0, max=100000, soft_max=100,
                             description="The throw shown below the list")
    collider_index: IntProperty(name="Active Collider", default=0, min=0, max=100000,
                                soft_max=100, description="The collider chosen in the list")
    preview_scale: FloatProperty(
        name="Preview Coarseness", default=2.0, min=1.0, soft_min=1.0, max=16.0, soft_max=4.0,
        description="Preview's particle separation over the one of Solver, without unit")


CLASSES = (MatterfitScene, MatterfitSession)


def active_item(collection, index):
    """The item at `index`, or None."""
    return collection[index] if 0 <= index < len(collection) else None


def active_take(settings):
    return active_item(settings.takes, settings.take_index)


def active_body(settings):
    return active_item(settings.bodies, settings.body_index)


def has_images(settings):
    """Whether a recording that is used is by images: its fits take the body's own law, have phases of their own
    in place of windows and resolutions, and no correction."""
    return any(capture.enabled and capture.source == "IMAGES" for capture in settings.captures)


def by_images_alone(settings):
    """Whether all recordings that are used are images, whose fits have no loss to choose either."""
    return has_images(settings) and all(
        capture.source == "IMAGES" for capture in settings.captures if capture.enabled)


def follow_points(settings):
    """Whether all recordings that are used are compared by the same points through time."""
    return settings.fit.loss == "TRACKS" and not has_images(settings)


def active_capture(settings):
    return active_item(settings.captures, settings.capture_index)


def compared_capture(settings):
    """The name of the capture whose errors are shown; "" is the first of the comparison."""
    capture = active_capture(settings)
    return capture.name if capture is not None and capture.enabled else ""
