# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch: the active take, once for each combination of values."""

import bpy
from bpy.props import (
    CollectionProperty,
    EnumProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .take import MatterfitTake

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


class MatterfitBatch(bpy.types.PropertyGroup):
    """What is varied, and where the results are."""

    run: PointerProperty(type=MatterfitTake)
    axes: CollectionProperty(type=MatterfitBatchAxis)
    axis_index: IntProperty(name="Active Quantity", default=0, min=0, max=100000, soft_max=100,
                            description="The quantity whose values stand below the list")
    at_once: IntProperty(name="Side by Side", default=1, min=1, max=1024, soft_max=16,
                         description="Simulations that run at the same time; each needs its memory")
    farm: EnumProperty(name="For", items=FARMS, default="NONE",
                       description="What Write Jobs writes beside the documents")


CLASSES = (MatterfitBatchAxis, MatterfitBatch)
