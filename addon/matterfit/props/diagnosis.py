# SPDX-License-Identifier: GPL-3.0-or-later
"""How a diagnosis is shown. What it found lies in the fit's cache (io/diagnosis.py)."""

import bpy
from bpy.props import BoolProperty, IntProperty


class MatterfitDiagnosis(bpy.types.PropertyGroup):
    """State of the Diagnose panel."""

    cause_index: IntProperty(
        name="Active Cause", default=0, min=0, max=100000, soft_max=100,
        description="The cause whose evidence is shown, and that Extend Model takes; the most "
                    "probable is 0")
    show_all: BoolProperty(
        name="All Causes", default=False,
        description="Show every cause that was tried, not only the most probable ones")


CLASSES = (MatterfitDiagnosis,)
