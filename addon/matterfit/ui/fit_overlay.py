# SPDX-License-Identifier: GPL-3.0-or-later
"""The loss curve of a fit, live while it runs, and the error of the fitted simulation over time, in
the 3D View above the graph of Compare."""

import os

from .. import jobs, laws
from ..compat import translate, translate_label
from ..io import comparison, error_bands, files, fit_results, takes
from ..jobs import JobError
from ..props import scene as scene_props
from . import diagnosis_overlay, drawing

LEFT, BOTTOM, WIDTH, HEIGHT, STEP = 124, 56, 320, 110, 190  # pixels
COLORS = (drawing.WHITE, (0.35, 0.75, 0.95, 1.0), (0.95, 0.75, 0.3, 1.0), (0.5, 0.85, 0.45, 1.0),
          (0.9, 0.5, 0.75, 1.0), (0.65, 0.6, 0.95, 1.0), (0.9, 0.5, 0.35, 1.0))

_known = {}


def forget():
    _known.clear()


def _once(name, key, read):
    """read(), again only when `key` has changed."""
    if _known.get(name, (None,))[0] != key:
        _known[name] = (key, read())
    return _known[name][1]


def running_fit(settings):
    """The folder of the fit that is running now, or ""."""
    job = jobs.registry.running
    if job is None or not settings.fit.run.folder:
        return ""
    folder = takes.locate(settings.fit.run).folder
    return folder if os.path.normpath(job.folder or ".") == os.path.normpath(folder) else ""


def curve(folder):
    """The Segments of a fit's history, read again when it has grown."""
    return _once("curve", (folder, fit_results.history_stamp(folder)),
                 lambda: fit_results.segments(fit_results.history(folder)))


def live_curve(folder):
    """The same of the fit that is running; nothing before it has done anything."""
    job = jobs.registry.running
    if job is not None and job.stale == fit_results.history_stamp(folder):
        return []
    return curve(folder)


def draw(context, below):
    """`below`: the lowest place is taken by Compare's graph. Returns the next place that is free."""
    scene = context.scene
    settings = scene.matterfit
    fit = settings.fit
    running = running_fit(settings)
    place = 1 if below else 0
    if not fit.run.folder or not (running or fit.done):
        return place
    folder = takes.locate(fit.run).folder
    scale = context.preferences.system.ui_scale
    if fit.show_error and not running:
        result = fit_results.load_quietly(folder)
        # One that was cancelled has not been compared: what lies there is of an earlier fit.
        whole = result is not None and result.status == "done"
        found = _error(settings, folder) if whole else None
        if found is not None:
            drawing.error_over_time(_rectangle(place), scale, found[0], scene.frame_current,
                                    translate_label("Error of the fit; blue: held out"), found[1],
                                    error_bands.of_fit(settings, scene_props.compared_capture(settings)))
            place += 1
    if fit.show_history:
        segments = live_curve(folder) if running else curve(folder)
        if segments:
            _draw_curve(_rectangle(place), scale, segments)
            place += 1
    if not running and diagnosis_overlay.draw(context, LEFT, BOTTOM + place * STEP):
        place += 1
    return place


def _rectangle(place):
    return LEFT, BOTTOM + place * STEP, WIDTH, HEIGHT


def _draw_curve(rectangle, scale, segments):
    low = min(min(segment.errors) for segment in segments)
    high = max(max(segment.errors) for segment in segments)
    last = segments[-1].places[-1]
    if high < 1.2 * low:
        low, high = low / 1.1, high * 1.1
    graph = drawing.Graph(rectangle, scale, (0, max(last, 1)), (low, high), logarithmic=True)
    laws = list(dict.fromkeys(segment.law for segment in segments))
    for index, segment in enumerate(segments):
        if index:
            graph.upright(segment.places[0], drawing.GREY)
        graph.curve(segment.places, segment.errors, COLORS[laws.index(segment.law) % len(COLORS)])
    newest = segments[-1]
    title = newest.stage
    if len(laws) > 1:
        title = f"{_law_name(newest.law)}: {title}"
        graph.legend([(_law_name(law), COLORS[index % len(COLORS)])
                      for index, law in enumerate(laws)])
    title = f"{translate_label('Fit')}: {title}"
    if newest.of_images:
        graph.labels(title, f"{percent(high)} %", f"{percent(low)} %",
                     translate("misfit {share} % of the search's first step").format(
                         share=percent(newest.errors[-1])))
    else:
        graph.labels(title, f"{high:.3g} mm", f"{low:.3g} mm", f"rms {newest.errors[-1]:.4g} mm")


def percent(share):
    return f"{100.0 * share:.3g}"


def _law_name(law):
    return translate_label(laws.name_of(law))


def _error(settings, folder):
    """(Comparison of the fitted scene with the active capture, [a, b) held out or None), or None."""
    name = scene_props.compared_capture(settings)

    def read():
        found = comparison.load_quietly(folder, name) or comparison.load_quietly(folder)
        return None if found is None else (found, _held_out(folder, name))

    return _once("error", (folder, name, comparison.stamp(folder)), read)


def _held_out(folder, name):
    try:
        captures = files.read_json(os.path.join(folder, "job.json")).get("captures", [])
    except JobError:
        return None
    chosen = [capture for capture in captures if capture.get("name") == name] or captures[:1]
    return chosen[0].get("holdout", {}).get("frames") if chosen else None
