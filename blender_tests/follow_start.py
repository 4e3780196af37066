# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows docs/start.md in a real window, step by step, and takes its pictures.

    xvfb-run -a -s "-screen 0 1400x900x24" env LIBGL_ALWAYS_SOFTWARE=1 \
        blender --factory-startup --python-exit-code 1 -P blender_tests/follow_start.py -- FOLDER [SECTION …]

The steps are read from the document: one that it has and this script does not, or that names another
button or key than the script presses, fails. Where docs/start.md says a key, its operator is called.
"""

import os
import re
import shutil
import sys
import tempfile
import time
import traceback

import bpy

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(HERE)
sys.path[:0] = [os.path.join(ROOT, "addon"), HERE]

import matterfit
import window_support
from matterfit import jobs, native, ui
from matterfit.io import check as io_check
from matterfit.io import takes

PICTURES, *ONLY = sys.argv[sys.argv.index("--") + 1:]
PICTURES = os.path.abspath(PICTURES)
LIMIT = 1500.0  # seconds for everything
STEP = re.compile(r"^(\d+\. |Eight throws at once: )(.*)$")
NAMED = re.compile(r"\*([^*]+)\*|`([^`]+)`")


def sections():
    """{title: [steps]} of the numbered lists of docs/start.md, and of the paragraph that is to be done."""
    found, title = {}, ""
    with open(os.path.join(ROOT, "docs", "start.md"), encoding="utf-8") as stream:
        for line in stream.read().split("\n"):
            if line.startswith("## "):
                title = line[3:]
            elif match := STEP.match(line):
                found.setdefault(title, []).append(match.group(2))
    return found


def named(step):
    """What a step says is to be pressed or typed: its emphasised words."""
    return [first or second for first, second in NAMED.findall(step)]


# -- doing ---------------------------------------------------------------------------------------

def settings():
    return bpy.context.scene.matterfit


def view(kind="WINDOW"):
    window, area = window_support.view()
    region = next(region for region in area.regions if region.type == kind)
    return {"window": window, "area": area, "region": region}


def press(name, **arguments):
    """A button of the tab; a job is waited for, while the window stays alive."""
    with bpy.context.temp_override(**view()):
        result = getattr(bpy.ops.matterfit, name)("INVOKE_DEFAULT", True, **arguments)
    if result == {"RUNNING_MODAL"}:
        while jobs.registry.running is not None:
            yield
        yield
    error = bpy.context.window_manager.matterfit.last_error
    if error:
        raise AssertionError(f"{name}: {error}")


def scene_3d(function):
    with bpy.context.temp_override(**view()):
        return function()


def picture(name):
    """The window as JPEG."""
    path = os.path.join(PICTURES, name)
    scratch = path + ".png"
    with bpy.context.temp_override(**view()):
        bpy.ops.screen.screenshot(filepath=scratch)
    image = bpy.data.images.load(scratch)
    save(image, path)
    bpy.data.images.remove(image)
    os.remove(scratch)


def save(image, path):
    form = bpy.context.scene.render.image_settings
    form.file_format, form.quality = "JPEG", 80
    before = bpy.context.scene.view_settings.view_transform
    bpy.context.scene.view_settings.view_transform = "Standard"
    image.save_render(path)
    bpy.context.scene.view_settings.view_transform = before


def show(frame):
    bpy.context.scene.frame_set(frame)
    for _ in range(3):
        yield


# -- a first jelly -------------------------------------------------------------------------------

def save_as():
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(work, "first.blend"))
    yield


def lift():
    scene_3d(lambda: bpy.ops.transform.translate(value=(0.0, 0.0, 2.0)))
    yield


def subdivide():
    scene_3d(lambda: bpy.ops.object.subdivision_set(level=2))
    yield


def smooth():
    scene_3d(bpy.ops.object.shade_smooth)
    yield


def add_body():
    yield from press("add_body", role="BODY")
    require(settings().bodies[0].material.preset == "JELLY", "the preset is not Jelly")


def plane():
    scene_3d(lambda: bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 0.0, 0.0)))
    # Without an active object the sidebar's tab Item has nothing to show, and ours is seen.
    bpy.context.view_layer.objects.active = None
    yield


def last_frame():
    bpy.context.scene.frame_end = 40
    yield


def bake():
    yield from press("bake")
    require(takes.finished_frames(settings().takes[0]), "the bake is not finished")


def floor():
    yield from show(17)
    names = [item.name for item in settings().takes[0].collection.all_objects
             if not item.hide_render]
    require(len(names) == 1, f"{names} are seen: one is expected")


def render():
    scene = bpy.context.scene
    scene.render.resolution_percentage = 40
    for item in dir(scene.render):  # no place of this machine goes into the picture
        if item.startswith("use_stamp_"):
            setattr(scene.render, item, False)
    bpy.ops.render.render()
    path = os.path.join(PICTURES, "start_jelly.jpg")
    scene.render.image_settings.file_format, scene.render.image_settings.quality = "JPEG", 85
    bpy.data.images["Render Result"].save_render(path)
    yield


# -- another throw -------------------------------------------------------------------------------

def add_take():
    yield from press("add_take")


def throw():
    yield from press("add_throw")
    row = settings().takes[1].throws[0]
    row.velocity_from, row.velocity = "VALUE", (3.0, 0.0, 0.0)
    bpy.context.scene.frame_set(1)
    for _ in range(3):
        yield
    picture("start_throw.jpg")


def bake_take():
    yield from press("bake")


def switch():
    for index in (0, 1):
        settings().take_index = index
        yield from show(17)
        seen = [take.name for take in settings().takes
                if take.collection is not None and not take.collection.hide_viewport]
        require(seen == [settings().takes[index].name], f"{seen} is shown")


def eight_throws():
    bpy.context.scene.frame_end = 8  # so far they come apart, and that takes a fifth of the time
    yield from press("add_axis", quantity="Cube\tvelocity[2]")
    settings().batch.axes[0].values = "1, 2, 3, 4, 5, 6, 7, 8"
    before = len(settings().takes)
    yield from press("run_batch")
    made = [take.name for take in settings().takes[before:] if take.baked]
    require(made == [f"Velocity Z = {value}" for value in range(1, 9)], f"the batch made {made}")


# -- a recording ---------------------------------------------------------------------------------

def open_beam():
    folder = os.path.join(work, "examples")
    shutil.copytree(os.path.join(ROOT, "docs", "examples"), folder)
    bpy.ops.wm.open_mainfile(filepath=os.path.join(folder, "beam.blend"))
    for _ in range(4):
        yield
    yield from open_tab()
    # As after the plane: with an active object the sidebar would open its tab Item.
    bpy.context.view_layer.objects.active = None
    scene_3d(lambda: bpy.ops.view3d.view_all())
    require(settings().captures[0].summary, "Capture says nothing of the recording")


def compare():
    yield from press("compare")
    errors.append(settings().compare.mean_mm)


def check():
    yield from press("check_fit")
    report = io_check.read(settings().fit.check)
    require(report is not None and report.known > 0, "Check says nothing of the recording")


def fit():
    yield from press("fit")
    require(settings().fit.done, "the fit has no result")


def apply():
    yield from press("apply_fit")


def compare_again():
    yield from compare()
    print(f"follow_start: mean error {errors[0]:.3f} mm before, {errors[1]:.3f} mm after the fit")
    require(errors[1] < 0.5 * errors[0], "the fit did not halve the error")
    scene_3d(lambda: bpy.ops.view3d.view_all())
    yield from show(settings().compare.worst[0].frame)
    picture("start_beam.jpg")


FOLLOWED = {
    "A first jelly": [
        (["File > Save As"], save_as), (["G", "Z", "2", "Enter"], lift),
        (["Object > Subdivision Set > Level 2", "Ctrl", "2"], subdivide),
        (["Object > Shade Smooth"], smooth),
        (["Matterfit > Bodies > Add Body", "Jelly"], add_body),
        (["Add > Mesh > Plane", "Size"], plane), ([], last_frame),
        (["Simulate > Bake", "Cancel", "Resume"], bake), (["Matterfit Take 1"], floor),
        (["Render > Render Image", "F12"], render)],
    "Another throw": [
        (["Rerun > Add Take"], add_take),
        (["Rerun > Throw Active Body", "Motion: Values Below", "Velocity X"], throw),
        (["Rerun > Bake Take"], bake_take), (["Take 1", "Take 2"], switch),
        (["Batch > Vary > Velocity Z", "1, 2, 3, 4, 5, 6, 7, 8", "Run Batch", "Compare", "Bake"],
         eight_throws)],
    "A recording": [
        (["File > Open", "docs/examples/beam.blend", "Home", "Capture"], open_beam),
        (["Compare > Compare"], compare), (["Fit > Check"], check), (["Fit > Fit"], fit),
        (["Fit > Apply to Body"], apply), (["Compare > Compare"], compare_again)],
}

work = ""
errors = []


def require(condition, fault):
    if not condition:
        raise AssertionError(fault)


def open_tab():
    """Ours is the active one of several tabs."""
    view()["area"].spaces.active.show_region_ui = True
    window_support.only_ours()
    for _ in range(4):
        yield
    window_support.other_tab()
    yield


def script():
    yield from open_tab()
    found = sections()
    require(set(FOLLOWED) <= set(found), f"docs/start.md has no section of {set(FOLLOWED)}")
    for title, known in FOLLOWED.items():
        require(len(found[title]) == len(known), f"{title}: {len(found[title])} steps in the "
                f"document, {len(known)} in the script")
        if ONLY and title not in ONLY:
            continue
        for number, (step, (words, act)) in enumerate(zip(found[title], known, strict=True), 1):
            require(named(step) == words, f"{title}, {number}: the document names {named(step)}")
            began = time.monotonic()
            yield from act()
            print(f"follow_start: {title}, {number}: {time.monotonic() - began:.1f} s", flush=True)


def main():
    global work
    work = tempfile.mkdtemp(prefix="follow_start_")
    os.makedirs(PICTURES, exist_ok=True)
    for cls in (ui.rerun.MATTERFIT_PT_rerun, ui.compare.MATTERFIT_PT_compare):
        cls.bl_options = set()  # open
    matterfit.register()
    native.require()
    bpy.context.preferences.view.show_splash = False
    window_support.draw_plainly()
    steps, end = script(), time.monotonic() + LIMIT

    def tick():
        try:
            if time.monotonic() > end:
                raise AssertionError(f"not at the end after {LIMIT} s")
            next(steps)
            return 0.1
        except StopIteration:
            print(f"follow_start: {', '.join(ONLY) or 'all of docs/start.md'}: followed", flush=True)
            status = 0
        except BaseException:
            traceback.print_exc()
            status = 1
        jobs.registry.stop_all()
        shutil.rmtree(work, ignore_errors=True)
        sys.stdout.flush()
        os._exit(status)

    bpy.app.timers.register(tick, first_interval=1.0, persistent=True)


main()
