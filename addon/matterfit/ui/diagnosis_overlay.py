# SPDX-License-Identifier: GPL-3.0-or-later
"""Error over time before and with the causes that a diagnosis has named, beside each other in the 3D
View, above what noise and the solver make."""

import numpy

from ..compat import translate_label
from ..io import error_bands
from ..props import scene as scene_props
from . import drawing

WIDTH, HEIGHT, GAP = 220, 110, 48  # pixels


def titles(bands):
    """[(words, values)] of the graphs, the left one first."""
    found = [("Before", bands.before)]
    if bands.has_after:
        found.append(("After", bands.after))
    return found


def top_of(bands):
    """Where both graphs end [mm], so that they can be compared."""
    return max(float(numpy.nanmax(values)) for values in (bands.before, bands.after, bands.noise, [1e-9])
               if numpy.isfinite(values).any())


def draw(context, left, bottom):
    """Returns whether anything was drawn."""
    settings = context.scene.matterfit
    if not settings.diagnosis.show_graph:
        return False
    bands = error_bands.of_fit(settings, scene_props.compared_capture(settings)) or error_bands.of_fit(settings)
    if bands is None or len(bands.frames) < 2:
        return False
    scale = context.preferences.system.ui_scale
    top = top_of(bands)
    for place, (title, values) in enumerate(titles(bands)):
        _graph((left + place * (WIDTH + GAP), bottom, WIDTH, HEIGHT), scale, bands, values, top,
               context.scene.frame_current, translate_label(title))
    return True


def _graph(rectangle, scale, bands, values, top, frame, title):
    first, last = bands.frames[0], bands.frames[-1]
    graph = drawing.Graph(rectangle, scale, (first, last), (0.0, top))
    for begin, end in bands.held_out_spans():
        graph.shade(begin - 0.5, end + 0.5, drawing.HELD_OUT)
    graph.floor(bands)
    graph.curve(bands.frames, values, drawing.WHITE)
    graph.upright(frame, drawing.BLUE)
    graph.labels(title, f"{top:.3g} mm", drawing.frame_text(first), drawing.frame_text(last))
