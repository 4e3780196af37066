# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch: the active take, once for each combination of values."""

import bpy
from bpy.props import (
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import reactions
from .take import MatterfitTake

TASKS = (("BAKE", "Bake", "Each combination is baked, and becomes a take"),
         ("COMPARE", "Compare", "Each is baked and compared with the captures, here and on a farm: "
                                "takes with their mean error, the best first"),
         ("FIT", "Fit", "Each is where a fit of its own begins, as the Fit panel is set"))

FARMS = (("NONE", "This Machine", "The documents alone, for the matterfit tool"),
         ("SLURM", "Slurm", "An array job beside them: sbatch slurm.sh"),
         ("FLAMENCO", "Flamenco", "A job for Flamenco 3 beside them, with its job type"))


class MatterfitBatchAxis(bpy.types.PropertyGroup):
    """One quantity that is varied, found by owner and key as in a fit's list."""

    name: StringProperty(name="Quantity", description="What is varied")
    owner: StringProperty(name="Owner", description="The body or collider that has it")
    key: StringProperty(name="Key", description="Which of its quantities")
    values: StringProperty(name="Values", description="Its values in SI units, separated by commas: "
                           "-1, -2, -3")


def _result_chosen(self, _context):
    reactions.batch_result_chosen(self.id_data.matterfit)


class MatterfitBatchResult(bpy.types.PropertyGroup):
    """One combination with what came of it."""

    name: StringProperty(name="Values", description="Its values, in the order of what is varied")
    folder: StringProperty(name="Cache Folder", description="Where its results are; that of its "
                           "take, where it has become one")
    error: FloatProperty(
        name="Mean Error [mm]", default=-1.0, min=-1.0, max=1e12, soft_min=0.0, soft_max=100.0,
        description="Mean distance of the captures' points in millimetres; -1: not known")


class MatterfitBatch(bpy.types.PropertyGroup):
    """What is varied, what is done with each combination, and where the results are."""

    task: EnumProperty(name="Each", items=TASKS, default="BAKE",
                       description="What is done with each combination")
    run: PointerProperty(type=MatterfitTake)
    fits: PointerProperty(type=MatterfitTake)
    varied: StringProperty(name="Varied", description="What the values of the results are of")
    results: CollectionProperty(type=MatterfitBatchResult)
    result_index: IntProperty(name="Active Result", default=0, min=0, max=100000, soft_max=100,
                              update=_result_chosen,
                              description="The combination whose take is shown")
    axes: CollectionProperty(type=MatterfitBatchAxis)
    axis_index: IntProperty(name="Active Quantity", default=0, min=0, max=100000, soft_max=100,
                            description="The quantity whose values stand below the list")
    at_once: IntProperty(name="Side by Side", default=1, min=1, max=1024, soft_max=16,
                         description="Simulations that run at the same time; each needs its memory")
    farm: EnumProperty(name="For", items=FARMS, default="NONE",
                       description="What Write Jobs writes beside the documents")


CLASSES = (MatterfitBatchAxis, MatterfitBatchResult, MatterfitBatch)
