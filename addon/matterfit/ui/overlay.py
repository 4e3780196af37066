# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat-map on captured points, its legend in mm or σ, and error over time, in the 3D View."""

import bpy
import numpy

from .. import compat
from ..compat import translate_label
from ..io import comparison, diagnosis, error_bands, takes, transforms
from ..props import scene as scene_props
from . import curves_overlay, drawing, fit_overlay, throw_overlay

# Dark blue, cyan, green, yellow, red: error from nothing to the range's end.
STOPS = numpy.array(((0.10, 0.20, 0.60), (0.10, 0.65, 0.80), (0.25, 0.75, 0.30),
                     (0.95, 0.85, 0.20), (0.90, 0.15, 0.10)))
LEGEND = (24, 60, 14, 160)  # left, bottom, width, height in pixels
GRAPH = (124, 56, 320, 110)

_LEAST = 1e-6  # mm, of what noise makes
GHOST = (0.85, 0.85, 0.9, 0.6)

_handles = []
_loaded = {}


def forget():
    """Drops what was read of a cache: another file was opened, or it was compared again."""
    _loaded.clear()
    fit_overlay.forget()
    curves_overlay.forget()


def active_comparison(scene):
    """The comparison of the active take, read once for each change on disk; None without one."""
    settings = scene.matterfit
    take = scene_props.active_take(settings)
    if take is None or not settings.compare.done or not take.folder:
        return None
    folder = takes.locate(take).folder
    name = scene_props.compared_capture(settings)
    key = (folder, name, comparison.stamp(folder))
    if _loaded.get("key") != key:
        _loaded.update(key=key, value=comparison.load_quietly(folder, name))
    return _loaded["value"]


def colors(errors, top):
    """(N, 4) colours of errors; `top` is drawn red."""
    place = numpy.clip(numpy.nan_to_num(errors) / max(top, 1e-12), 0.0, 1.0) * (len(STOPS) - 1)
    low = numpy.minimum(place.astype(int), len(STOPS) - 2)
    part = (place - low)[:, None]
    rgb = STOPS[low] * (1.0 - part) + STOPS[low + 1] * part
    return numpy.concatenate((rgb, numpy.ones((len(rgb), 1))), axis=1).astype(numpy.float32)


def shown_errors(settings, found):
    """(errors as the heat-map shows them (T, N), which points it leaves out (T, N), unit)."""
    compare = settings.compare
    bands = None
    if compare.heat_unit == "SIGMA" or compare.significant_only:
        bands = error_bands.of_fit(settings, scene_props.compared_capture(settings))
    if bands is None:  # nothing was diagnosed that would tell
        return found.errors, numpy.zeros(found.errors.shape, dtype=bool), "mm"
    with numpy.errstate(invalid="ignore", divide="ignore"):
        sigmas = found.errors / numpy.maximum(bands.usual_at(found.frames), _LEAST)[:, None]
    left_out = sigmas < error_bands.SIGNIFICANT if compare.significant_only else numpy.zeros(sigmas.shape, dtype=bool)
    return (sigmas, left_out, "σ") if compare.heat_unit == "SIGMA" else (found.errors, left_out, "mm")


def shown_now(settings, found):
    """The same, done again only where something has changed."""
    compare = settings.compare
    folder = takes.locate(settings.fit.run).folder if settings.fit.run.folder else ""
    key = (compare.heat_unit, compare.significant_only, folder, diagnosis.stamp(folder) if folder else None)
    if _loaded.get("shown_of") is not found or _loaded.get("shown_key") != key:
        _loaded.update(shown_of=found, shown_key=key, shown=shown_errors(settings, found))
    return _loaded["shown"]


def top_of_range(settings, found):
    compare = settings.compare
    errors, _left_out, unit = shown_now(settings, found)
    if compare.range_mode == "FIXED":
        return compare.range_sigma if unit == "σ" else compare.range_mm
    if unit == "mm":
        return max(found.percentile95, 1e-6)
    known = errors[numpy.isfinite(errors)]
    return max(float(numpy.percentile(known, 95.0)), 1e-6) if known.size else 1.0


def point_sets(compare, found, row, unit, top):
    """[(points, colours, size in pixels)] of one sample: simulated places as grey ghosts, captured
    ones by their error, in Blender units."""
    every, left_out, _unit = shown_now(compare.id_data.matterfit, found)
    errors = every[row]
    seen = numpy.isfinite(errors) & ~left_out[row]
    sets = []
    if compare.show_simulation:
        ghosts = (found.simulated[row][seen] * unit).astype(numpy.float32)
        sets.append((ghosts, numpy.tile(numpy.float32(GHOST), (len(ghosts), 1)),
                     max(0.7 * compare.point_size, 1.0)))
    if compare.show_heatmap:
        captured = (found.captured[row][seen] * unit).astype(numpy.float32)
        sets.append((captured, colors(errors[seen], top), compare.point_size))
    return sets


def draw_points():
    context = bpy.context
    scene = context.scene
    settings = scene.matterfit
    compare = settings.compare
    if not compare.done or not (compare.show_heatmap or compare.show_simulation):
        return
    found = active_comparison(scene)
    row = None if found is None else found.row_at(scene.frame_current + scene.frame_subframe)
    if row is None:
        return
    import gpu
    unit = 1.0 / transforms.metres(scene)
    top = top_of_range(settings, found)
    sets = point_sets(compare, found, row, unit, top)
    gpu.state.blend_set("ALPHA")
    for points, color, size in sets:
        gpu.state.point_size_set(size)
        _draw("POINTS", points, color)
    if compare.show_links:
        errors, left_out, _unit = shown_now(settings, found)
        seen = numpy.isfinite(errors[row]) & ~left_out[row]
        ends = numpy.empty((2 * int(seen.sum()), 3), dtype=numpy.float32)
        ends[0::2] = found.captured[row][seen] * unit
        ends[1::2] = found.simulated[row][seen] * unit
        _draw("LINES", ends, numpy.repeat(colors(errors[row][seen], top), 2, axis=0))
    gpu.state.blend_set("NONE")
    gpu.state.depth_test_set("NONE")
    gpu.state.point_size_set(1.0)


def _draw(kind, points, color):
    """What lies behind or inside something shows through it faintly."""
    if len(points) == 0:  # a frame in which nothing was seen
        return
    import gpu
    from gpu_extras.batch import batch_for_shader
    shader = compat.flat_shader()
    for test, part in (("GREATER", 0.3), ("LESS_EQUAL", 1.0)):
        gpu.state.depth_test_set(test)
        faded = (color * (1.0, 1.0, 1.0, part)).astype(numpy.float32)
        batch_for_shader(shader, kind, {"pos": points, "color": faded}).draw(shader)


def draw_legend():
    context = bpy.context
    scene = context.scene
    settings = scene.matterfit
    compare = settings.compare
    if not compare.done or not (compare.show_heatmap or compare.show_graph):
        return
    found = active_comparison(scene)
    if found is None:
        return
    scale = context.preferences.system.ui_scale
    if compare.show_heatmap:
        _legend(scale, top_of_range(settings, found), shown_now(settings, found)[2])
    if compare.show_graph:
        _graph(scale, scene, found)


def _legend(scale, top, unit):
    from gpu_extras.batch import batch_for_shader
    left, bottom, width, height = (value * scale for value in LEGEND)
    drawing.box(left - 8 * scale, bottom - 12 * scale, width + 64 * scale, height + 40 * scale,
                drawing.BACKGROUND)
    count = len(STOPS)
    points, color, indices = [], [], []
    for index, stop in enumerate(STOPS):
        y = bottom + height * index / (count - 1)
        points += [(left, y, 0), (left + width, y, 0)]
        color += [(*stop, 1.0)] * 2
        if index:
            first = 2 * index - 2
            indices += [(first, first + 1, first + 3), (first, first + 3, first + 2)]
    shader = compat.flat_shader()
    batch_for_shader(shader, "TRIS", {"pos": points, "color": color}, indices=indices).draw(shader)
    for index in range(count):
        value = top * index / (count - 1)
        drawing.text(f"{value:.3g}", left + width + 6 * scale,
                     bottom + height * index / (count - 1) - 4 * scale, scale)
    title = translate_label("Error [σ]" if unit == "σ" else "Error [mm]")
    drawing.text(title, left, bottom + height + 12 * scale, scale)


def _graph(scale, scene, found):
    settings = scene.matterfit
    drawing.error_over_time(GRAPH, scale, found, scene.frame_current,
                            translate_label("Mean (white) and largest (red) error"), None,
                            error_bands.of_fit(settings, scene_props.compared_capture(settings)))


def draw_fit():
    place = fit_overlay.draw(bpy.context,
                             compare_graph_shown(bpy.context.scene.matterfit.compare))
    curves_overlay.draw(bpy.context, place)


def draw_throws():
    throw_overlay.draw()


def compare_graph_shown(compare):
    return compare.done and compare.show_graph


def register():
    if bpy.app.background:
        return
    unregister()  # a second handler would draw everything twice
    view = bpy.types.SpaceView3D
    _handles.append(view.draw_handler_add(draw_points, (), "WINDOW", "POST_VIEW"))
    _handles.append(view.draw_handler_add(draw_throws, (), "WINDOW", "POST_VIEW"))
    _handles.append(view.draw_handler_add(draw_legend, (), "WINDOW", "POST_PIXEL"))
    _handles.append(view.draw_handler_add(draw_fit, (), "WINDOW", "POST_PIXEL"))


def unregister():
    for handle in _handles:
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
    _handles.clear()
    forget()
