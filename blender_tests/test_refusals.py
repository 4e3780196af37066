# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as a job document: what is refused, and what a refusal leaves."""

import os

import bpy
from matterfit import laws, native, quantities
from matterfit.jobs import JobError
from support import SceneCase, needs_library

NAN = float("nan")


class RefusalTest(SceneCase):
    def test_what_is_refused(self):
        """Each error names what is wrong and what to do."""
        with self.assertRaisesRegex(JobError, "no body to simulate.*Add Body"):
            self.document()
        item = self.cube()
        body = self.body(item)
        solver = self.settings.solver
        solver.use_range, solver.frame_start, solver.frame_end = True, 20, 10
        with self.assertRaisesRegex(JobError, "Frame range.*before it starts"):
            self.document()
        solver.use_range = False
        body.source = "POINTS"
        with self.assertRaisesRegex(JobError, "body 'Cube': no file is chosen"):
            self.document()
        body.filepath = "//missing.ply"
        with self.assertRaisesRegex(JobError, "missing.ply does not exist"):
            self.document()
        body.source = "OBJECT"
        body.object = None
        with self.assertRaisesRegex(JobError, "no object is chosen"):
            self.document()
        bpy.ops.mesh.primitive_plane_add()
        flat = bpy.context.active_object
        flat.data.clear_geometry()
        body.object = flat
        with self.assertRaisesRegex(JobError, "has no surface"):
            self.document()

    def test_stretched_time(self):
        """Keys and caches would be played at another speed than they are simulated at."""
        self.jelly()
        self.scene.render.frame_map_new = 50
        message = self.fails(bpy.ops.matterfit.bake, ["Time Stretching is 100 to 50", "Output > Frame Range"])
        self.assertNotIn("Traceback", message)
        self.scene.render.frame_map_old = 50
        self.document()

    def test_what_is_no_number(self):
        """A driver that divides by zero gives a field none."""
        body = self.jelly()
        fields = ((body, "velocity", (0.0, NAN, 0.0), "'Cube', Velocity Y"),
                  (body.material, "E", NAN, "'Cube', Young's Modulus"),
                  (self.settings.solver, "gravity", (0.0, 0.0, NAN), "Gravity Z"),
                  (self.settings.solver, "cfl", NAN, "CFL"),
                  (self.settings.solver, "particle_separation", NAN, "Particle Separation"))
        for owner, name, value, words in fields:
            with self.subTest(name):
                before = getattr(owner, name)
                before = before if isinstance(before, float) else tuple(before)
                setattr(owner, name, value)
                message = self.fails(bpy.ops.matterfit.bake, [f"{words} is not a number. Type one"])
                self.assertNotIn("nan", message.lower())
                self.assertNotIn("Traceback", message)
                setattr(owner, name, before)
        body.object.location.x = NAN
        self.fails(bpy.ops.matterfit.bake, ["object 'Cube': its location, rotation or scale is not a number"])

    def test_refused_a_take_claims_no_folder(self):
        body = self.jelly()
        track = self.cube("Track")
        capture = self.settings.captures.add()
        capture.name, capture.source, capture.object = "Track", "OBJECT", track
        body.object = None
        for press in (bpy.ops.matterfit.write_job, bpy.ops.matterfit.compare):
            self.fails(press, ["no object is chosen"])
            self.assertEqual([take.folder for take in self.settings.takes], [""])
            self.assertEqual([name for name in os.listdir(self.folder) if name.startswith("cache_")], [])

    def test_a_hold_out_beyond_the_end(self):
        self.jelly()
        capture = self.settings.captures.add()
        capture.name, capture.source, capture.object = "Track", "OBJECT", self.cube("Track")
        capture.holdout, capture.holdout_start = "FRAMES", 30
        with self.assertRaisesRegex(JobError, "starts at frame 30, after the last frame 6. Set From"):
            self.document("compare")

    def test_a_tenth_of_a_millimetre(self):
        self.body(self.cube(size=1e-4))
        with self.assertRaisesRegex(
                JobError, "Particle Separation is 8.3 µm, .* below 0.03 mm.*Unit Scale"):
            self.document()
        self.scene.unit_settings.scale_length = 4.0
        self.document()

    def test_same_names(self):
        first = self.body(self.cube("A b"))
        self.body(self.cube("A c"))
        first = self.settings.bodies[0]
        first.name = "A_c"
        with self.assertRaisesRegex(JobError, "Rename one"):
            self.document()

    def test_a_group_that_is_not_there(self):
        body = self.body(self.cube())
        pin = body.pins.add()
        pin.kind, pin.vertex_group = "VERTEX_GROUP", "nowhere"
        with self.assertRaisesRegex(JobError, "no vertex group 'nowhere'"):
            self.document()

    @needs_library
    def test_what_a_field_takes_the_library_takes(self):
        """A field that is dragged to its end is not refused at the bake."""
        material = self.jelly(separation=0.05).material
        for law, _label, _about in laws.CANDIDATES:  # the published one takes a file
            material.law = law
            for name in (*laws.PARAMETERS[law], *laws.DAMPING):
                row = quantities.find(f"material.{name}")
                if row.size > 1:
                    continue
                before = getattr(material, name)
                for value in (row.least, row.most):
                    if value == 0.0 and row.positive:
                        continue
                    with self.subTest(law=law, name=name, value=value):
                        setattr(material, name, value)
                        document, folder = self.document()
                        native.validate(document, folder, 1)
                setattr(material, name, before)
