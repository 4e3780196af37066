# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab in a real window, drawn part by part, with a picture of each.

    xvfb-run -a -s "-screen 0 1400x900x24" env LIBGL_ALWAYS_SOFTWARE=1 \
        blender --factory-startup --python-exit-code 1 -P blender_tests/window.py -- PICTURE.png

PICTURE shows the tab as it opens; beside it lie panel_status.png, panel_capture.png, …
With the native library a bake and a fit run modally, are cancelled, resumed to their end, and undone.
Fails where a panel is not drawn or raises, the overlay raises or shows nothing, or a modal job does not
end as it should, also when the add-on is switched off under it.
"""

import os
import shutil
import sys
import tempfile
import time
import traceback

import bpy

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(os.path.dirname(HERE), "addon"), HERE]

import fake_fit
import matterfit
import numpy
from matterfit import jobs, native, ui
from matterfit.io import takes
from matterfit.jobs import State
from matterfit.ops import job_operator
from matterfit.ui import fit_overlay, overlay
from window_background import cancel, modal_check, modal_filling, modal_reading
from window_scene import build_scene, fake_comparison, fake_report, fake_result, fake_results, record_fall
from window_support import begun, crop, draw_plainly, modal, only_ours, other_tab, undo, view, wait_for

PICTURE = os.path.abspath(sys.argv[sys.argv.index("--") + 1])
LIMIT = 1500.0  # seconds for everything, beside other work

HANDLERS = ("draw_points", "draw_legend", "draw_fit", "draw_throws")
drawn = {}
faults = []


def watch(cls):
    """Counts draws; Blender only prints what a draw raises."""
    original = cls.draw

    def draw(self, context):
        drawn[cls.__name__] = drawn.get(cls.__name__, 0) + 1
        try:
            original(self, context)
        except Exception:
            faults.append(f"{cls.__name__}:\n{traceback.format_exc()}")

    cls.draw = draw


def watch_handler(name):
    """The same for a draw handler of the overlay."""
    original = getattr(overlay, name)

    def draw():
        drawn[name] = drawn.get(name, 0) + 1
        try:
            original()
        except Exception:
            faults.append(f"overlay.{name}:\n{traceback.format_exc()}")

    setattr(overlay, name, draw)


shown = set()  # names of panels; empty: all
whole = True  # with the panels below them


def limit_to(cls):
    """The panel polls as before, and is shown only in its own pictures."""
    original = cls.poll.__func__

    @classmethod
    def poll(klass, context):
        names = {klass.__name__, getattr(klass, "bl_parent_id", "") if whole else ""}
        return (not shown or bool(names & shown)) and original(klass, context)

    cls.poll = poll


def prepare():
    for cls in ui.CLASSES:
        if issubclass(cls, bpy.types.Panel):
            cls.bl_options = set(cls.bl_options) - {"DEFAULT_CLOSED"}
            watch(cls)
            limit_to(cls)
    for name in HANDLERS:
        watch_handler(name)
    only_ours()
    matterfit.register()
    preferences = bpy.context.preferences
    preferences.view.show_splash = False
    preferences.view.show_developer_ui = False
    draw_plainly()


def scroll_to_end(back=0):
    """To the end of the sidebar, and `back` steps up again."""
    window, area = view()
    region = next(region for region in area.regions if region.type == "UI")
    with bpy.context.temp_override(window=window, area=area, region=region):
        for _ in range(40):
            bpy.ops.view2d.scroll_down()
        for _ in range(back):
            bpy.ops.view2d.scroll_up()


def picture(name, sidebar=False):
    path = PICTURE if name == "" else f"{os.path.splitext(PICTURE)[0]}_{name}.png"
    os.makedirs(os.path.dirname(path), exist_ok=True)
    window, area = view()
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.screen.screenshot(filepath=path)
    if not os.path.isfile(path) or os.path.getsize(path) < 5000:
        faults.append(f"{path}: no picture was taken")
    elif sidebar:
        crop(path, area)


def legend_pixels():
    """(rows, columns, 3) of the window where the overlay's legend is."""
    path = os.path.splitext(PICTURE)[0] + "_legend.png"
    window, area = view()
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.screen.screenshot(filepath=path)
    image = bpy.data.images.load(path)
    width, height = image.size
    pixels = numpy.empty(width * height * 4, dtype=numpy.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    os.remove(path)
    region = next(region for region in area.regions if region.type == "WINDOW")
    scale = bpy.context.preferences.system.ui_scale
    left, bottom, wide, high = (int(value * scale) for value in overlay.LEGEND)
    left, bottom = left + region.x, bottom + region.y
    return pixels.reshape(height, width, 4)[bottom:bottom + high, left:left + wide, :3]


def check_legend():
    """The overlay is there when it is on, and gone when it is off."""
    compare = bpy.context.scene.matterfit.compare
    shown_pixels = legend_pixels()
    compare.show_heatmap = compare.show_graph = False
    yield
    yield
    changed = numpy.abs(legend_pixels() - shown_pixels).max(axis=2) > 0.05
    print(f"window: the overlay's legend covers {100.0 * changed.mean():.0f} % of its place")
    if changed.mean() < 0.9:
        faults.append("the overlay's legend is not drawn where it should be")
    compare.show_heatmap = compare.show_graph = True


def sigma_view(settings):
    """The heat-map in σ, with the error before and after what was named below it."""
    fit, compare = settings.fit, settings.compare
    fit.show_history = fit.show_error = False
    compare.heat_unit, compare.significant_only = "SIGMA", True
    bpy.context.scene.frame_set(15)
    yield
    yield
    picture("sigma")
    fit.show_history = fit.show_error = True
    compare.heat_unit, compare.significant_only = "MM", False


def open_view():
    window, area = view()
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.screen.screen_full_area(use_hide_panels=False)
    window, area = view()
    area.spaces.active.show_region_ui = True
    area.spaces.active.shading.type = "SOLID"
    # Without an active object the tab Item has nothing to show and goes too.
    bpy.context.view_layer.objects.active = None


def look_at_all():
    window, area = view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.view3d.view_axis(type="FRONT")
        for item in bpy.context.scene.objects:
            item.select_set(item.type == "MESH")
        bpy.ops.view3d.view_selected()
    # Without an active object the tab Item has nothing to show and goes too.
    bpy.context.view_layer.objects.active = None


def show(*names, below=True):
    global whole
    whole = below
    shown.clear()
    shown.update(names)
    window, area = view()
    area.tag_redraw()


PARTS = ("status", "capture", "bodies", "solver", "simulate", "rerun", "output", "batch")


def script(folder):
    """A generator: everything between two yields happens before the window is drawn again."""
    open_view()
    yield
    yield
    other_tab()
    yield
    yield
    picture("first", sidebar=True)
    positions, times = build_scene(folder)
    fake_results()
    look_at_all()
    yield
    yield
    picture("")
    for part in PARTS:
        show("MATTERFIT_PT_" + part)
        yield
        yield
        if part == "bodies":  # with all below it, which was drawn now, it is higher than the window
            show("MATTERFIT_PT_bodies", below=False)
            yield
            yield
        picture(part, sidebar=True)
    fake_comparison(positions, times)
    show("MATTERFIT_PT_compare")
    yield
    yield
    picture("compare")
    yield from check_legend()
    show("MATTERFIT_PT_fit")
    yield
    yield
    picture("fit", sidebar=True)
    scroll_to_end(back=5)
    yield
    yield
    picture("fit_check", sidebar=True)
    bpy.ops.matterfit.clear_check()
    fake_result(positions, times)
    yield
    yield
    scroll_to_end(back=5)
    yield
    yield
    picture("fit_result")
    # A curve of two laws has a legend.
    fake_fit.write_history(takes.locate(bpy.context.scene.matterfit.fit.run).folder, [
        {"stage": "frames 1-8", "law": law, "rms_mm": 20.0 / (i + 1)}
        for law in ("fixed_corotated", "von_mises") for i in range(8)])
    bpy.context.scene.matterfit.show_curves = True
    view()[1].tag_redraw()
    yield
    yield
    picture("fit_laws")
    bpy.context.scene.matterfit.show_curves = False
    fake_report()
    settings = bpy.context.scene.matterfit
    settings.compare.done = False  # so that nothing above it is half in the picture
    show("MATTERFIT_PT_compare")
    yield
    yield
    picture("diagnose", sidebar=True)
    settings.compare.done = True
    yield from sigma_view(settings)
    settings.compare.worst_index = 0
    if bpy.context.scene.frame_current != settings.compare.worst[0].frame:
        faults.append("the list of worst frames did not jump")
    settings.compare.done = False
    settings.captures.clear()
    if not native.load():
        print(f"window: the modal bake is left out: {native.load_error()}")
        return
    let_go()
    show("MATTERFIT_PT_status", "MATTERFIT_PT_simulate")
    yield from modal_filling(picture, faults)
    yield from modal_reading(faults)
    yield from modal_bake()
    yield from switched_off()
    yield from modal_fit()


def let_go():
    settings = bpy.context.scene.matterfit
    settings.bodies[0].pins.clear()
    settings.bodies[0].masses.clear()
    settings.takes[0].throws.clear()


def modal_bake():
    """Bake, cancel, undo, resume, verify, undo: through the very buttons."""
    show("MATTERFIT_PT_status", "MATTERFIT_PT_simulate")
    settings = bpy.context.scene.matterfit
    let_go()
    settings.solver.particle_separation = 0.0125
    bpy.context.scene.frame_end = 40
    if modal("bake") != {"RUNNING_MODAL"}:
        raise AssertionError("Bake does not run modally")
    job = yield from begun()
    yield from wait_for(lambda: job.snapshot.frame >= 4 or job.ended, 400.0, "frame 4")
    picture("running")
    if job.ended:
        raise AssertionError(f"the bake ended before it could be cancelled: {job.error}")
    yield from cancel(job, "a bake")
    if job.state is not State.CANCELLED:
        raise AssertionError(f"Cancel gave {job.state}: {job.error}")
    yield
    folder = bpy.context.scene.matterfit.takes[0].folder
    undo()
    yield
    if bpy.context.scene.matterfit.takes[0].folder != folder:
        raise AssertionError("undo after Cancel took the take's cache folder away")
    if modal("resume") != {"RUNNING_MODAL"}:
        raise AssertionError("Resume does not run modally")
    job = yield from begun()
    yield from wait_for(lambda: job.ended, 400.0, "the end of Resume")
    yield
    if job.state is not State.DONE:
        raise AssertionError(f"Resume gave {job.state}: {job.error}")
    take = bpy.context.scene.matterfit.takes[0]
    if not take.baked or take.collection is None or not take.collection.objects:
        raise AssertionError("nothing was attached")
    bpy.context.scene.frame_set(20)
    show("MATTERFIT_PT_status", "MATTERFIT_PT_output")
    yield
    yield
    picture("baked")
    if modal("verify") != {"RUNNING_MODAL"}:
        raise AssertionError("Verify does not run modally")
    job = yield from begun()
    yield from wait_for(lambda: job.ended, 400.0, "the end of Verify")
    yield
    if "as they were written" not in bpy.context.window_manager.matterfit.verify:
        faults.append(f"Verify: {bpy.context.window_manager.matterfit.last_error or job.state}")
    undo()  # Verify changed nothing and is no step
    yield
    take = bpy.context.scene.matterfit.takes[0]
    if take.baked or not take.folder:
        faults.append("one undo did not take back what was attached, and only that")
    yield from undone_free()


def undone_free():
    """Undo after Free brings the take back, without objects that would play deleted files."""
    if modal("bake", onto="REPLACE") != {"RUNNING_MODAL"}:
        raise AssertionError("Bake does not run modally")
    job = yield from begun()
    yield from wait_for(lambda: job.ended, 400.0, "the end of a bake of what is there")
    yield
    before = len(bpy.context.scene.matterfit.takes)
    window, area = view()
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.matterfit.free("EXEC_DEFAULT", True)
    yield
    undo()
    yield
    settings = bpy.context.scene.matterfit
    left = [item.name for item in bpy.context.scene.objects if item.get("matterfit")]
    if len(settings.takes) != before or settings.takes[0].baked or left:
        faults.append(f"undo after Free: baked {settings.takes[0].baked}, {left} play deleted files")
    if settings.bodies[0].object.hide_viewport:
        faults.append("undo after Free hides the artist's own object")


def switched_off():
    """The add-on is disabled under a running bake: the job, the timer, the cursor and the text in
    the status bar end with it."""
    ended = []
    original = job_operator.JobOperator._remove_timer

    def remove_timer(self, context):
        ended.append(self._timer is not None)
        original(self, context)

    job_operator.JobOperator._remove_timer = remove_timer
    # Other inputs: what is baked already would be done before it can be disabled.
    bpy.context.scene.matterfit.solver.particle_separation = 0.014
    if modal("bake") != {"RUNNING_MODAL"}:
        raise AssertionError("Bake does not run modally")
    job = yield from begun()
    yield from wait_for(lambda: job.snapshot.frame >= 2 or job.ended, 400.0, "frame 2")
    running = not job.ended
    other_tab(False)  # else it would be the active one from here on
    matterfit.unregister()
    if not running or job.state is not State.CANCELLED:
        faults.append(f"disabled under a running job, which gave {job.state}: {job.error}")
    if ended.count(True) != 1:
        faults.append("the timer of a running job stays when the add-on is disabled")
    yield
    matterfit.register()
    yield
    yield
    other_tab()
    yield


def modal_fit():
    """Fit, cancel, apply the best so far, undo that, resume to the end, through the very buttons."""
    show("MATTERFIT_PT_status", "MATTERFIT_PT_fit")
    settings = bpy.context.scene.matterfit
    let_go()
    settings.bodies[0].material.preset = "JELLY"
    settings.bodies[0].material.E = 6e4
    settings.bodies[0].velocity = (0.0, 0.0, -2.0)
    settings.bodies[1].enabled = False
    settings.solver.particle_separation = 0.0167
    bpy.context.scene.frame_end = 10
    record_fall()
    for row in settings.fit.parameters:
        row.enabled = row.key in ("material.E", "velocity")
    settings.fit.done = False
    yield from modal_check()
    scroll_to_end(back=5)
    yield
    yield
    picture("checked", sidebar=True)
    bpy.ops.matterfit.clear_check()
    settings.bodies[0].material.E = 1.5e5
    settings.bodies[0].velocity = (0.1, 0.0, -1.5)
    if modal("fit") != {"RUNNING_MODAL"}:
        raise AssertionError("Fit does not run modally")
    job = yield from begun()
    yield from wait_for(lambda: job.ended or any(
        len(segment.places) >= 2 for segment in fit_overlay.live_curve(job.folder)), 400.0,
        "the second iteration")
    picture("fitting")
    if job.ended:
        raise AssertionError(f"the fit ended before it could be cancelled: {job.error}")
    yield from cancel(job, "a fit")
    yield
    if job.state is not State.CANCELLED or not bpy.context.scene.matterfit.fit.done:
        raise AssertionError(f"Cancel of the fit gave {job.state}: {job.error}")
    before = bpy.context.scene.matterfit.bodies[0].material.E
    if modal("apply_fit", undo=True) != {"FINISHED"}:
        raise AssertionError("the best so far cannot be applied")
    yield
    if bpy.context.scene.matterfit.bodies[0].material.E == before:
        faults.append("Apply to Body changed nothing")
    undo()
    yield
    if bpy.context.scene.matterfit.bodies[0].material.E != before:
        faults.append("one undo did not take back what was applied")
    if modal("resume_fit") != {"RUNNING_MODAL"}:
        raise AssertionError("Resume of the fit does not run modally")
    job = yield from begun()
    yield from wait_for(lambda: job.ended, 400.0, "the end of the fit")
    yield
    yield
    if job.state is not State.DONE:
        raise AssertionError(f"Resume of the fit gave {job.state}: {job.error}")
    scroll_to_end()
    yield
    yield
    picture("fitted")


def main():
    prepare()
    folder = tempfile.mkdtemp(prefix="window_", dir=os.path.dirname(HERE) + "/build")
    steps = script(folder)
    began = time.monotonic()

    def finish(status):
        jobs.registry.stop_all()
        shutil.rmtree(folder, ignore_errors=True)
        panels = [cls.__name__ for cls in ui.CLASSES if issubclass(cls, bpy.types.Panel)]
        missing = [name for name in (*panels, *HANDLERS) if name not in drawn]
        if missing:
            faults.append(f"never drawn: {', '.join(missing)}")
        for fault in faults:
            print(f"window: {fault}")
        print(f"window: {len(panels)} panels, {len(drawn)} parts drawn, {len(faults)} faults")
        sys.stdout.flush()
        os._exit(1 if faults or status else 0)

    def step():
        if time.monotonic() - began > LIMIT:
            faults.append(f"not done after {LIMIT} s")
            finish(1)
        try:
            next(steps)
        except StopIteration:
            finish(0)
        except Exception:
            faults.append(traceback.format_exc())
            finish(1)
        return 0.4

    bpy.app.timers.register(step, first_interval=1.0)


main()
