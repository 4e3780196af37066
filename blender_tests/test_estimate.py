# SPDX-License-Identifier: GPL-3.0-or-later
"""The work that Estimate foresees is what a bake then does, within a factor of two; how long that takes is
the machine's to say."""

import os

import bpy
from matterfit import native
from matterfit.io import job_document
from support import SceneCase, needs_library, printed_json, run_cli


@needs_library
class WorkTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.scene.frame_end = 12

    def check(self):
        document, folder = self.document()
        foreseen = native.estimate(document, folder)
        path = job_document.write(document, folder)
        done = printed_json(run_cli("bake", path, "--json", "--restart", timeout=300))
        particles = sum(body["particles"] for body in foreseen["bodies"])
        self.assertEqual(particles, foreseen["particles"])
        ratio = foreseen["substeps"] / done["substeps"]
        self.assertTrue(0.5 < ratio < 2.0, (foreseen["substeps"], done["substeps"]))
        written = sum(os.path.getsize(os.path.join(base, name))
                      for base, _folders, names in os.walk(folder) for name in names)
        self.assertTrue(0.5 < foreseen["disk_bytes"] / written < 2.0, (foreseen["disk_bytes"], written))

    def test_what_hits_the_ground(self):
        """A solid that is squeezed, and what pours, both thrown at the floor: substeps get shorter there."""
        for preset in ("JELLY", "WATER", "SAND"):
            with self.subTest(preset):
                for item in list(self.scene.objects):
                    bpy.data.objects.remove(item)
                self.settings.bodies.clear()
                body = self.jelly(separation=0.02, size=0.2, location=(0.0, 0.0, 0.25))
                body.material.preset = preset
                self.settings.solver.particle_separation = 0.02
                body.velocity = (0.0, 0.0, -3.0)
                self.check()

    def test_two_bodies(self):
        """A stiff one decides the substeps of a soft one."""
        self.jelly(separation=0.025, location=(0.0, 0.0, 0.15))
        other = self.jelly(separation=0.025, name="Other", location=(0.0, 0.0, 0.4))
        other.material.E = 5e5
        self.check()
