# SPDX-License-Identifier: GPL-3.0-or-later
"""A scan that somebody else trained: filled, dropped on a ground, baked as splats, drawn frame by frame."""

import glob
import os
import unittest

import bpy
import numpy
from matterfit import native
from matterfit.io import blender_cameras, files, takes
from support import ROOT, SceneCase, needs_library, read

SCAN = os.path.join(ROOT, "..", "shared", "data", "splats", "academic_tarot_cards.splat")
SIZE = 96


def needs_scan(function):
    return function if os.path.isfile(SCAN) else unittest.skip(f"{SCAN} is not there")(function)


def places(path):
    head, _, values = read(path).partition(b"end_header\n")
    columns = head.count(b"property float")
    return numpy.frombuffer(values, dtype="<f4").reshape(-1, columns)[:, :3]


class ThrownScanTest(SceneCase):
    @needs_library
    @needs_scan
    def test_from_the_file_to_pictures(self):
        self.scene.frame_end = 5
        row = self.settings.bodies.add()
        row.name, row.source, row.filepath, row.file_up = "Cards", "GAUSSIANS", SCAN, "-Y"
        row.opacity_threshold = 0.1
        row.velocity = (0.0, 0.0, -3.0)
        # The deck without the cloth it stands on, a tenth above the ground.
        bpy.ops.object.empty_add(type="CUBE", radius=1.0, location=(0.0, 0.0, 0.06))
        row.crop = bpy.context.active_object
        row.crop.scale = (0.14, 0.33, 0.46)
        self.settings.solver.use_ground, self.settings.solver.ground_height = True, -0.5
        self.settings.solver.particle_separation = 0.06
        self.settings.output.surface = False
        bpy.ops.object.camera_add(location=(0.0, -3.5, 0.0), rotation=(numpy.pi / 2, 0.0, 0.0))
        self.scene.camera = bpy.context.active_object
        self.scene.render.resolution_x = self.scene.render.resolution_y = SIZE
        bpy.context.view_layer.update()
        self.assertEqual(bpy.ops.matterfit.bake(), {"FINISHED"}, self.error())
        folder = takes.locate(takes.ensure_active(self.settings)).folder
        written = sorted(glob.glob(os.path.join(folder, "splat", "*.ply")))
        self.assertEqual(len(written), 5)
        first, last = places(written[0]), places(written[-1])
        self.assertGreater(len(first), 10000)
        self.assertTrue(numpy.isfinite(last).all())
        self.assertLess(last[:, 2].mean(), first[:, 2].mean() - 0.05)
        self.assertGreater(numpy.percentile(last[:, 2], 1), -0.56, "the ground holds it")

        document = files.read_json(os.path.join(folder, "job.json"))
        document["task"], document["render"] = "render", {"cameras": "cameras.json"}
        document["scene"]["frames"] = [1, 3]
        document["output"] = {"folder": "drawn", "splats": document["output"]["splats"]}
        files.write_json(os.path.join(folder, "cameras.json"),
                         {"frames": [blender_cameras.shot(self.scene, self.scene.camera, "view")]})
        path = files.write_json(os.path.join(folder, "render.json"), document)
        run = native.start(path, restart=1)
        run.wait()
        outcome = run.outcome()
        self.assertEqual(outcome.status, 0, outcome.error)
        self.assertEqual(outcome.result["render"]["notes"], [])
        rows = []
        for frame in (1, 2):
            image = bpy.data.images.load(os.path.join(folder, "drawn", "render", "camera_0", f"{frame:04d}.png"))
            pixels = numpy.array(image.pixels[:]).reshape(SIZE, SIZE, 4)
            seen = pixels[..., 3] > 0.5
            self.assertGreater(seen.sum(), 300)
            self.assertGreater(pixels[seen][:, :3].std(), 0.1, "it has a pattern")
            rows.append(numpy.nonzero(seen)[0].mean())
        self.assertLess(rows[1], rows[0] - 0.5, "it falls")
