# SPDX-License-Identifier: GPL-3.0-or-later
"""How a diagnosis is shown, and what was said of its causes. What it found lies in the fit's cache
(io/diagnosis.py)."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, StringProperty

from .compare import redraw


class MatterfitIgnoredCause(bpy.types.PropertyGroup):
    """A cause that the artist does not believe, whichever diagnosis names it."""

    name: StringProperty(name="Cause", description="Its name in reports, such as drag_quadratic")


class MatterfitDiagnosis(bpy.types.PropertyGroup):
    """State of the Diagnose panel."""

    cause_index: IntProperty(
        name="Active Cause", default=0, min=0, max=100000, soft_max=100,
        description="The cause whose evidence is shown, and that Extend Model takes; the most "
                    "probable is 0")
    show_all: BoolProperty(
        name="All Causes", default=False,
        description="Show every cause that was tried, not only the most probable ones")
    ignored: CollectionProperty(type=MatterfitIgnoredCause)
    use_limit: BoolProperty(
        name="Limit Runs", default=False,
        description="End the search for causes after so many simulations, with the verdict of what was "
                    "found; else after as many as a scene of this size can afford")
    limit: IntProperty(
        name="Simulations", default=1000, min=100, max=1000000, soft_max=10000,
        description="Simulations of the search for causes; those of derivatives and of the solver's "
                    "error come on top")
    show_graph: BoolProperty(
        name="Before and After", default=True, update=redraw,
        description="Draw the error over time before and with the causes that were named beside each "
                    "other in the viewport, above what noise and the solver make")


def is_ignored(settings, effect):
    return any(row.name == effect for row in settings.diagnosis.ignored)


def set_ignored(settings, effect, ignored):
    rows = settings.diagnosis.ignored
    for index in reversed(range(len(rows))):
        if rows[index].name == effect:
            rows.remove(index)
    if ignored:
        rows.add().name = effect


CLASSES = (MatterfitIgnoredCause, MatterfitDiagnosis)
