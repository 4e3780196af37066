# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scripts share that run in a real window."""

import time

import bpy
import numpy
from matterfit import jobs
from matterfit.ops import job_operator


class WINDOW_PT_other(bpy.types.Panel):
    """Another tab, as every Blender has: the strip of tabs takes a part of the sidebar."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "View"
    bl_label = "Other"

    def draw(self, _context):
        self.layout.label(text="Not ours")


def other_tab(there=True):
    """The tab that was drawn before stays the active one where this comes to it."""
    if there == hasattr(bpy.types, "WINDOW_PT_other"):
        return
    (bpy.utils.register_class if there else bpy.utils.unregister_class)(WINDOW_PT_other)


def only_ours():
    """Without the other tabs ours is the active one (3.4 has no call that switches tabs). Once it is
    drawn other_tab() brings the strip of tabs back."""
    for cls in list(bpy.types.Panel.__subclasses__()):
        if (getattr(cls, "bl_space_type", "") == "VIEW_3D"
                and getattr(cls, "bl_region_type", "") == "UI"
                and getattr(cls, "bl_category", "") != "Matterfit"
                and hasattr(bpy.types, cls.__name__)):
            try:
                bpy.utils.unregister_class(cls)
            except RuntimeError:
                pass


def draw_plainly():
    """Without samples for smooth edges, which are nearly half of what a renderer in software draws, and
    less often while a job runs beside it."""
    bpy.context.preferences.system.viewport_aa = "OFF"
    job_operator.INTERVAL = 0.5


def view():
    """(window, area) of the 3D view."""
    window = bpy.context.window_manager.windows[0]
    area = max((area for area in window.screen.areas if area.type == "VIEW_3D"),
               key=lambda area: area.width)
    return window, area


def modal(operator, undo=False, **arguments):
    """Presses the button; `undo`: one that ends at once makes its step only where it is told."""
    window, area = view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        return getattr(bpy.ops.matterfit, operator)("INVOKE_DEFAULT", undo, **arguments)


def wait_for(condition, seconds, what):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"{what} did not happen within {seconds} s")
        yield


def begun():
    """The job of the button that was pressed, once the scene is read for it; use `yield from`."""
    yield from wait_for(lambda: not jobs.registry.current.reading, 200.0, "the scene read")
    return jobs.registry.current


def undo():
    window, area = view()
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.ed.undo()


def crop(path, area):
    """Keeps the sidebar's part of the picture, without the empty space below the panel."""
    region = next(region for region in area.regions if region.type == "UI")
    image = bpy.data.images.load(path)
    width, height = image.size
    pixels = numpy.empty(width * height * 4, dtype=numpy.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    pixels = pixels.reshape(height, width, 4)
    left = region.x
    part = pixels[region.y:region.y + region.height, left:left + region.width]
    # Rows that hold text are bright in all colours; the viewport behind an empty sidebar is not, nor
    # its axes.
    busy = numpy.nonzero(part[:, :-40, :3].min(axis=2).max(axis=1) > 0.45)[0]
    low = max(int(busy.min()) - 16, 0) if busy.size else 0
    part = numpy.ascontiguousarray(part[low:])
    result = bpy.data.images.new("crop", part.shape[1], part.shape[0])
    result.pixels.foreach_set(part.ravel())
    result.filepath_raw = path
    result.file_format = "PNG"
    result.save()
    bpy.data.images.remove(result)
