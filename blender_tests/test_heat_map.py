# SPDX-License-Identifier: GPL-3.0-or-later
"""One heat-map at a time: that of the active take and the active capture, as the disk has it now.

What all handlers of the viewport draw is recorded in place of the graphics card."""

import os
import sys
from types import SimpleNamespace
from unittest import mock

import bpy
import numpy
from fake_cache import write_pc2
from matterfit import ui
from matterfit.io import files, job_document, takes
from support import SceneCase


class Views:
    """bpy.types.SpaceView3D's list of drawing handlers."""

    def __init__(self):
        self.handlers = {}

    def draw_handler_add(self, function, _arguments, _region, when):
        handle = object()
        self.handlers[handle] = (when, function)
        return handle

    def draw_handler_remove(self, handle, _region):
        del self.handlers[handle]


class HeatMapTest(SceneCase):
    """Two takes, each compared with two captures of one point. The error [mm] and the captured place
    along x [m] are the number of the take, and ten times the number of the capture."""

    def setUp(self):
        super().setUp()
        self.jelly(separation=0.1, location=(0.0, 0.0, 0.3))
        self.folders = [self.compared(takes.ensure_active(self.settings), 1)]
        self.folders.append(self.compared(takes.add(self.settings, "Other"), 2))
        for name in ("one", "two"):
            self.settings.captures.add().name = name
        for take in self.settings.takes:
            take.compared = True
        self.settings.capture_index = 0
        self.settings.take_index = 0
        self.views = Views()
        screen = SimpleNamespace(app=SimpleNamespace(background=False), context=bpy.context,
                                 types=SimpleNamespace(SpaceView3D=self.views))
        patch = mock.patch.object(ui.overlay, "bpy", screen)
        patch.start()
        self.addCleanup(patch.stop)
        ui.overlay.register()
        self.addCleanup(ui.overlay.unregister)

    def compared(self, take, number):
        folder = takes.claim(take)
        document = job_document.build(self.scene, take, folder, "bake")
        document["captures"] = [{"name": name, "tracks": f"{name}.npz"} for name in ("one", "two")]
        job_document.write(document, folder)
        write_pc2(os.path.join(folder, "points", "Cube.pc2"), numpy.zeros((6, 8, 3)))
        files.write_json(os.path.join(folder, "manifest.json"), {"files": {}})
        self.write(folder, "one", 10 + number)
        self.write(folder, "two", 20 + number)
        return folder

    def write(self, folder, name, value):
        """What a comparison leaves of one capture."""
        places = numpy.full((6, 1, 3), [float(value), 0.0, 0.0])
        times = numpy.arange(6) / 24.0
        files.write_npz(os.path.join(folder, f"compare_{name}.npz"), {
            "error_mm": numpy.full((6, 1), float(value)), "times": times, "captured": places,
            "labels": numpy.array(["a"])})
        files.write_npz(os.path.join(folder, f"simulated_{name}.npz"),
                        {"positions": places + [0.0, 0.0, 1.0], "times": times})

    def drawn(self):
        """(places along x of the heat-map's points, the number at its red end or "") of what is drawn.
        A point that is drawn by two handlers is there twice."""
        batches, words = [], []

        def batch(_shader, kind, content, indices=None):  # noqa: ARG001 as gpu_extras has it
            batches.append((kind, content))
            return mock.Mock()

        gpu, text = mock.MagicMock(), mock.MagicMock()
        text.draw.side_effect = lambda _font, said: words.append(said)
        text.dimensions.return_value = (1.0, 1.0)
        with mock.patch.dict(sys.modules, {
                "gpu": gpu, "blf": text, "gpu_extras": mock.MagicMock(),
                "gpu_extras.batch": SimpleNamespace(batch_for_shader=batch)}):
            for when in ("POST_VIEW", "POST_PIXEL"):
                for called, function in self.views.handlers.values():
                    if called == when:
                        function()
        # Both depth tests draw it: in front of things whole, behind them faint.
        points = [content["pos"][:, 0].tolist() for kind, content in batches
                  if kind == "POINTS" and content["color"][0, 3] == 1.0
                  and content["color"][0, :3].tolist() != numpy.float32(ui.overlay.GHOST[:3]).tolist()]
        titles = words.count("Error [mm]")
        self.assertEqual(titles, len(points), "a heat-map and its legend")
        top = [words[index - 1] for index, said in enumerate(words) if said == "Error [mm]"]
        return points, top

    def shows(self, *values):
        places, tops = self.drawn()
        self.assertEqual(places, [[float(value)] for value in values])
        self.assertEqual(tops, [str(value) for value in values])

    def test_of_the_active_capture_and_take(self):
        self.shows(11)
        self.settings.capture_index = 1
        self.shows(21)
        self.settings.take_index = 1
        self.shows(22)
        self.settings.capture_index = 0
        self.shows(12)
        bpy.ops.matterfit.add_take()
        self.shows()

    def test_none_that_is_stale(self):
        """After another comparison that one; none of what a capture was before it was moved, in whichever
        take; none of a cache that was freed."""
        self.shows(11)
        self.write(self.folders[0], "one", 15)
        os.utime(os.path.join(self.folders[0], "compare_one.npz"), (2e9, 2e9))  # later than any clock's tick
        self.shows(15)
        self.settings.take_index = 1
        bpy.ops.matterfit.free()
        self.shows()
        self.settings.take_index = 0
        self.shows(15)
        self.settings.captures[0].location.x = 1.0
        for index in (0, 1):
            self.settings.take_index = index
            self.shows()

    def test_switched_off(self):
        self.settings.compare.show_heatmap = False
        self.shows()

    def test_registered_twice(self):
        """As a script that reloads add-ons does."""
        ui.overlay.register()
        self.shows(11)
        ui.overlay.unregister()
        self.assertEqual(self.views.handlers, {})
        ui.overlay.register()
        self.shows(11)
